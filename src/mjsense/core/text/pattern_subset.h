// SPDX-License-Identifier: Apache-2.0
#pragma once
// The subset of regular expressions that Python's `re` and PCRE2 interpret alike. Users write
// Python syntax and PCRE2 does the matching. Syntax that the two interpret differently, or that
// only one supports, is rejected rather than translated.

#include <string_view>

namespace mjsense {

// Throws ValueError "not supported: ... at position n" for syntax other than
//
// . ^ $ | * + ? {n} {n,} {n,m}, optionally followed by ? (lazy) or + (possessive)
// [sets] with ranges; a literal [ inside is written \[
//   \d \D \w \W \s \S \b \B \A \a \f \n \r \t \xhh, and a backslash before punctuation
//   ( ) (?: ) (?= ) (?! ) (?<= ) (?<! ) (?> ) (?P<name> )
//   (?i) (?m) (?s), for the whole pattern or as (?i: ) for a part
//
// PCRE2's compiler reports syntax that is wrong in both.
void check_pattern_subset(std::string_view pattern);

}  // namespace mjsense
