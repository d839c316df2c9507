// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/json_text.h"

#include <fmt/format.h>

#include <charconv>
#include <limits>

namespace mjsense::replay {
namespace {

constexpr int kMaxDepth = 64;

struct SyntaxError {
  std::size_t at;
  const char* expected;
};

class Parser {
 public:
  Parser(std::string_view text, const OnNumber& on_number) : text_(text), on_number_(on_number) {}

  void document() {
    value(0);
    blank();
    if (at_ != text_.size()) throw SyntaxError{at_, "the end"};
  }

 private:
  char peek() const { return at_ < text_.size() ? text_[at_] : '\0'; }

  void blank() {
    while (peek() == ' ' || peek() == '\n' || peek() == '\t' || peek() == '\r') ++at_;
  }

  void expect(char c, const char* expected) {
    if (peek() != c) throw SyntaxError{at_, expected};
    ++at_;
  }

  bool word(std::string_view w) {
    if (text_.substr(at_, w.size()) != w) return false;
    at_ += w.size();
    return true;
  }

  void number_is(double x) const {
    if (on_number_) on_number_(path_, x);
  }

  void value(int depth) {
    if (depth > kMaxDepth) throw SyntaxError{at_, "less nesting"};
    blank();
    switch (peek()) {
      case '{':
        return object(depth);
      case '[':
        return array(depth);
      case '"':
        string(nullptr);
        return;
      default:
        break;
    }
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    if (word("null")) return;
    if (word("true")) return number_is(1);
    if (word("false")) return number_is(0);
    if (word("NaN")) return number_is(std::numeric_limits<double>::quiet_NaN());
    if (word("Infinity")) return number_is(kInfinity);
    if (word("-Infinity")) return number_is(-kInfinity);
    number();
  }

  void object(int depth) {
    ++at_;
    blank();
    if (peek() == '}') {
      ++at_;
      return;
    }
    while (true) {
      blank();
      const std::size_t parent = path_.size();
      std::string key;
      string(&key);
      blank();
      expect(':', "':'");
      if (!path_.empty()) path_ += '/';
      path_ += key;
      value(depth + 1);
      path_.resize(parent);
      blank();
      if (peek() == '}') break;
      expect(',', "',' or '}'");
    }
    ++at_;
  }

  void array(int depth) {
    ++at_;
    blank();
    if (peek() == ']') {
      ++at_;
      return;
    }
    while (true) {
      value(depth + 1);
      blank();
      if (peek() == ']') break;
      expect(',', "',' or ']'");
    }
    ++at_;
  }

  // Escapes are validated but not decoded, because keys are only used as names.
  void string(std::string* out) {
    expect('"', "a string");
    const std::size_t start = at_;
    while (peek() != '"') {
      if (at_ >= text_.size() || static_cast<unsigned char>(text_[at_]) < 0x20)
        throw SyntaxError{at_, "'\"'"};
      if (text_[at_++] != '\\') continue;
      if (at_ >= text_.size() ||
          std::string_view("\"\\/bfnrtu").find(text_[at_]) == std::string_view::npos) {
        throw SyntaxError{at_, "an escape"};
      }
      if (text_[at_++] != 'u') continue;
      for (int i = 0; i < 4; ++i, ++at_) {
        if (at_ >= text_.size() || !std::isxdigit(static_cast<unsigned char>(text_[at_])))
          throw SyntaxError{at_, "4 hex digits"};
      }
    }
    if (out) *out = text_.substr(start, at_ - start);
    ++at_;
  }

  std::size_t digits(const char* expected) {
    const std::size_t start = at_;
    while (peek() >= '0' && peek() <= '9') ++at_;
    if (at_ == start) throw SyntaxError{at_, expected};
    return at_ - start;
  }

  // "-12.5e-3": no leading zeros, and digits on both sides of the decimal point.
  void number() {
    const std::size_t start = at_;
    if (peek() == '-') ++at_;
    const bool zero = peek() == '0';
    if (digits("a value") > 1 && zero) throw SyntaxError{start, "no leading zeros"};
    if (peek() == '.') {
      ++at_;
      digits("a digit");
    }
    if (peek() == 'e' || peek() == 'E') {
      ++at_;
      if (peek() == '+' || peek() == '-') ++at_;
      digits("a digit");
    }
    if (on_number_) on_number_(path_, value_of(text_.substr(start, at_ - start)));
  }

  // As in Python, numbers beyond the range of double become infinite or 0.
  static double value_of(std::string_view number) {
    double x = 0;
    const auto read = std::from_chars(number.data(), number.data() + number.size(), x);
    if (read.ec != std::errc::result_out_of_range) return x;
    const std::size_t exponent = number.find_first_of("eE");
    const bool negative = number.starts_with('-');
    const bool small =
        exponent == number.npos ? number[negative] == '0' : number[exponent + 1] == '-';
    const double value = small ? 0 : std::numeric_limits<double>::infinity();
    return negative ? -value : value;
  }

  std::string_view text_;
  const OnNumber& on_number_;
  std::size_t at_ = 0;
  std::string path_;
};

}  // namespace

std::string parse_json(std::string_view text, const OnNumber& on_number) {
  try {
    Parser(text, on_number).document();
    return "";
  } catch (const SyntaxError& error) {
    return fmt::format("byte {}: expected {}", error.at, error.expected);
  }
}

std::string_view trim_row(std::string_view row) {
  const std::size_t end = row.find_last_not_of('\0');
  return end == std::string_view::npos ? std::string_view{} : row.substr(0, end + 1);
}

}  // namespace mjsense::replay
