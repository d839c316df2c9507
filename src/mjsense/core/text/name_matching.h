// SPDX-License-Identifier: Apache-2.0
#pragma once
// Regular expressions with the semantics of Python's `re` (case-sensitive, Unicode), for matching
// names of MuJoCo elements. PCRE2 does the matching. pattern_subset.h defines the accepted
// patterns, which include all 52 of mjlab 1.6. (Translating all of Python's syntax took three times
// as much code.)

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace mjsense {

class Regex {
 public:
  // Throws ValueError that shows the position of a syntax error; `context` is the prefix of the
  // message.
  explicit Regex(std::string_view pattern, std::string_view context = "regular expression");
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

// Returns the ascending indices of the names that fully match a pattern. Every pattern must match a
// name and no name may match two patterns; otherwise throws ValueError with the patterns, the names
// and the nearest names.
std::vector<int> match_names(std::span<const std::string> patterns,
                             std::span<const std::string> names, std::string_view context);

// Whether the text contains one of . * + ? [ ] { } ( ) \ | ^ $
bool is_regex(std::string_view text);

// Whether an `exclude` entry drops a name. An entry for which is_regex() is true is searched
// anywhere in the name; any other entry is an exact name.
class Exclude {
 public:
  Exclude(std::span<const std::string> entries, std::string_view context);
  bool drops(std::string_view name) const;

 private:
  std::vector<std::string> exact_;
  std::vector<Regex> search_;
};

}  // namespace mjsense
