#pragma once
// From the syntax of Python's `re` (str patterns) to that of PCRE2.

#include <string>
#include <string_view>

namespace mjsense {

struct PcrePattern {
  std::string text;
  bool ascii = false;  // (?a): \w \d \s \b know ASCII only
};

// Throws ValueError where Python would (unknown escapes, nothing to repeat, unknown groups ...);
// the message shows the position. Not supported: \N{name} and (?a:...) for a part of a pattern.
PcrePattern translate_python_regex(std::string_view pattern);

}  // namespace mjsense
