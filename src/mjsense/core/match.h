// SPDX-License-Identifier: Apache-2.0
#pragma once
// Regular expressions with the meaning of Python's `re`: case-sensitive, Unicode. Names of elements
// are matched by them. PCRE2 does the work; pattern_subset.h says which patterns are taken: all 52
// of mjlab 1.6 are. (A translator of all of Python's syntax stood here: three times the code.)

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

class Regex {
 public:
  // Throws ValueError that shows where a pattern is wrong; `place` starts its message.
  explicit Regex(std::string_view pattern, std::string_view place = "regular expression");
  ~Regex();
  Regex(Regex&&) noexcept;
  Regex& operator=(Regex&&) noexcept;

  bool fullmatch(std::string_view text) const;  // re.fullmatch
  bool search(std::string_view text) const;     // re.search
  const std::string& pattern() const { return pattern_; }

 private:
  struct Code;
  std::string pattern_;
  std::unique_ptr<Code> code_;
};

// Indices, ascending, of the names that a pattern matches whole. Every pattern must match a name
// and no name may match two patterns, else ValueError with the patterns, the names, and the nearest
// names.
std::vector<int> match_names(std::span<const std::string> patterns,
                             std::span<const std::string> names, std::string_view place);

// Does an `exclude` entry drop the name? An entry with one of . * + ? [ ] { } ( ) \ | ^ $ in it is
// a regular expression searched anywhere in the name, another one an exact name.
class Exclude {
 public:
  Exclude(std::span<const std::string> entries, std::string_view place);
  bool drops(std::string_view name) const;

 private:
  std::vector<std::string> exact_;
  std::vector<Regex> search_;
};

}  // namespace mjsense
