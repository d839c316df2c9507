// SPDX-License-Identifier: Apache-2.0
#pragma once
// Regular expressions that Python's `re` and PCRE2 read alike. Users write Python's; PCRE2 matches
// them. What the two read differently, or only one knows, is refused rather than translated.

#include <string_view>

namespace mjsense {

// Throws ValueError "not supported: ... at position n" for anything but
//
//   . ^ $ | * + ? {n} {n,} {n,m}, lazy (?) or possessive (+) behind them
//   [sets] with ranges; [ inside as \[
//   \d \D \w \W \s \S \b \B \A \a \f \n \r \t \xhh, and a backslash before punctuation
//   ( ) (?: ) (?= ) (?! ) (?<= ) (?<! ) (?> ) (?P<name> )
//   (?i) (?m) (?s), for the whole pattern or as (?i: ) for a part
//
// Syntax that is wrong in both is left to PCRE2's compiler.
void check_pattern_subset(std::string_view pattern);

}  // namespace mjsense
