// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/text/pattern_subset.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }
bool is_hex(char c) { return is_digit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }

class Scanner {
 public:
  explicit Scanner(std::string_view pattern) : in_(pattern) {}

  void run() {
    // Whether a quantifier may follow depends on what precedes it. At the start, after an anchor
    // and after another quantifier it is an error in Python, but not in PCRE2.
    bool repeatable = false;
    while (!end()) {
      const char c = peek();
      if (c == '*' || c == '+' || c == '?' || c == '{') {
        const std::size_t at = pos_;
        quantifier();
        if (!repeatable) refuse("a quantifier without an expression before it", at);
        repeatable = false;
      } else if (c == '\\') {
        repeatable = escape();
      } else if (c == '[') {
        set();
        repeatable = true;
      } else if (c == '(') {
        repeatable = group();
      } else {
        ++pos_;
        repeatable = c != '^' && c != '$' && c != '|';
      }
    }
  }

 private:
  bool end() const { return pos_ >= in_.size(); }
  char peek(std::size_t ahead = 0) const {
    return pos_ + ahead < in_.size() ? in_[pos_ + ahead] : '\0';
  }
  bool take(std::string_view text) {
    if (!in_.substr(pos_).starts_with(text)) return false;
    pos_ += text.size();
    return true;
  }
  [[noreturn]] static void refuse(std::string_view what, std::size_t at) {
    throw ValueError(fmt::format("not supported: {} at position {}", what, at));
  }

  void quantifier() {
    const std::size_t start = pos_++;
    if (in_[start] == '{') {
      const std::size_t digits = pos_;
      while (is_digit(peek())) ++pos_;
      if (pos_ == digits) refuse("'{' without a number (write \\{ for the character)", start);
      if (peek() == ',') ++pos_;
      while (is_digit(peek())) ++pos_;
      if (!take("}"))
        refuse("'{' that does not begin {n}, {n,} or {n,m} (write \\{ for the character)", start);
    }
    if (peek() == '?' || peek() == '+') ++pos_;
  }

  // Returns false for an anchor.
  bool escape() {
    const std::size_t start = pos_++;
    const char c = peek();
    ++pos_;
    if (c == 'b' || c == 'B' || c == 'A') return false;
    if (!character_escape(c)) refuse(fmt::format("\\{}", c), start);
    return true;
  }

  // Escapes (a backslash and `c`) that have the same meaning inside and outside of a set.
  bool character_escape(char c) {
    if (c == 'x') {
      if (!is_hex(peek()) || !is_hex(peek(1))) return false;
      pos_ += 2;
      return true;
    }
    if (is_letter(c) || is_digit(c)) {
      return std::string_view("dDwWsSafnrt").find(c) != std::string_view::npos;
    }
    return c >= ' ' && c <= '~';
  }

  void set() {
    const std::size_t start = pos_++;
    take("^");
    bool class_before = false;  // \d and the like cannot start a range
    for (bool first = true; first || peek() != ']'; first = false) {
      if (end()) refuse("a set without a closing ]", start);
      const std::size_t at = pos_;
      const char c = peek();
      ++pos_;
      if (c == '[') refuse("'[' in a set (write \\[ for the character)", at);
      if (c == '-' && class_before && peek() != ']') refuse("a range that starts with a class", at);
      class_before = false;
      if (c == '\\') {
        const char e = peek();
        ++pos_;
        if (e != 'b' && !character_escape(e)) refuse(fmt::format("\\{} in a set", e), at);
        class_before = std::string_view("dDwWsS").find(e) != std::string_view::npos;
      }
      if (peek() == '-' && peek(1) == '\\' &&
          std::string_view("dDwWsS").find(peek(2)) != std::string_view::npos) {
        refuse("a range that ends with a class", pos_);
      }
    }
    ++pos_;
  }

  // Reads the start of a group. Always returns false, because no quantifier may follow it. A ')' is
  // treated as any other character here; the compiler checks whether groups are closed.
  bool group() {
    const std::size_t start = pos_++;
    if (peek() == '*') refuse("(*", start);
    if (!take("?")) return false;
    for (const char* head : {":", "=", "!", "<=", "<!", ">"}) {
      if (take(head)) return false;
    }
    if (take("P<")) {
      name();
      return false;
    }
    const std::size_t flags = pos_;
    while (peek() == 'i' || peek() == 'm' || peek() == 's') ++pos_;
    if (pos_ > flags && take(":")) return false;
    if (pos_ > flags && start == 0 && take(")")) return false;
    refuse("this kind of group", start);
  }

  void name() {
    const std::size_t start = pos_;
    while (is_letter(peek()) || peek() == '_' || (pos_ > start && is_digit(peek()))) ++pos_;
    if (peek() != '>') refuse("this group name", start);
    ++pos_;
  }

  std::string_view in_;
  std::size_t pos_ = 0;
};

}  // namespace

void check_pattern_subset(std::string_view pattern) { Scanner(pattern).run(); }

}  // namespace mjsense
