#include "mjsense/core/pattern_characters.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

bool is_hex(char c) { return is_digit(c) || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F'); }

}  // namespace

std::string code_point(std::uint32_t c) { return fmt::format("\\x{{{:x}}}", c); }

bool PatternCharacters::take(std::string_view text) {
  if (in_.substr(pos_, text.size()) != text) return false;
  pos_ += text.size();
  return true;
}

void PatternCharacters::fail(std::string_view what) const {
  throw ValueError(fmt::format("{} at position {}", what, pos_));
}

std::uint32_t PatternCharacters::hex(int digits, char letter) {
  std::uint32_t value = 0;
  for (int i = 0; i < digits; ++i) {
    const char c = peek();
    if (!is_hex(c)) fail(fmt::format("incomplete escape \\{}", letter));
    value = 16 * value + static_cast<std::uint32_t>(is_digit(c) ? c - '0' : (c | 0x20) - 'a' + 10);
    ++pos_;
  }
  if (value > 0x10FFFF) fail("bad escape: no such character");
  return value;
}

// A character given by an escape that means the same in and outside of a set; false: another
// escape, nothing taken.
bool PatternCharacters::character_escape(std::uint32_t& value) {
  const char c = peek();
  switch (c) {
    case 'a':
      value = 7;
      break;
    case 'f':
      value = 12;
      break;
    case 'n':
      value = 10;
      break;
    case 'r':
      value = 13;
      break;
    case 't':
      value = 9;
      break;
    case 'v':
      value = 11;
      break;
    case 'x':
      ++pos_;
      value = hex(2, c);
      return true;
    case 'u':
      ++pos_;
      value = hex(4, c);
      return true;
    case 'U':
      ++pos_;
      value = hex(8, c);
      return true;
    default:
      return false;
  }
  ++pos_;
  return true;
}

void PatternCharacters::literal_escape() {
  const unsigned char c = static_cast<unsigned char>(peek());
  if (is_letter(static_cast<char>(c)) || is_digit(static_cast<char>(c)))
    fail(fmt::format("bad escape \\{}", peek()));
  if (c < 0x80) out_ += '\\';
  out_ += in_[pos_++];
}

// Python's white space has the four separators 1C-1F beside what PCRE2 knows.
std::string PatternCharacters::space(bool negated, bool in_set) const {
  if (ascii_) return negated ? "\\S" : "\\s";
  if (in_set) return negated ? "\\S" : "\\s\\x{1c}-\\x{1f}";
  return negated ? "[^\\s\\x{1c}-\\x{1f}]" : "[\\s\\x{1c}-\\x{1f}]";
}

void PatternCharacters::set() {
  const std::size_t start = pos_;
  ++pos_;
  out_ += '[';
  if (take("^")) out_ += '^';
  bool first = true;
  while (true) {
    if (end()) {
      pos_ = start;
      fail("unterminated character set");
    }
    if (peek() == ']' && !first) break;
    first = false;
    const bool is_class = set_item();
    if (peek() == '-' && pos_ + 1 < in_.size() && peek(1) != ']') {
      if (is_class) fail("bad character range");
      ++pos_;
      out_ += '-';
      if (set_item()) fail("bad character range");
    } else if (peek() == '-' && pos_ + 1 < in_.size()) {
      ++pos_;
      out_ += "\\-";
    }
  }
  ++pos_;
  out_ += ']';
}

// One character or class of a set; true for a class.
bool PatternCharacters::set_item() {
  if (peek() == '\\') {
    ++pos_;
    if (end()) fail("bad escape (end of pattern)");
    std::uint32_t value = 0;
    const char c = peek();
    if (character_escape(value)) {
      out_ += code_point(value);
    } else if (c == 'b') {
      ++pos_;
      out_ += code_point(8);
    } else if (std::string_view("dDwW").find(c) != std::string_view::npos) {
      ++pos_;
      out_ += std::string("\\") + c;
      return true;
    } else if (c == 's' || c == 'S') {
      ++pos_;
      out_ += space(c == 'S', true);
      return true;
    } else if (is_octal(c)) {
      for (int i = 0; i < 3 && is_octal(peek()); ++i) value = 8 * value + (in_[pos_++] - '0');
      if (value > 0377) fail("octal escape outside of range 0-0o377");
      out_ += code_point(value);
    } else {
      literal_escape();
    }
    return false;
  }
  // In PCRE2 "[:" and "[." have meanings inside a set, and a "-" may make a range.
  const unsigned char c = static_cast<unsigned char>(peek());
  if (c < 0x80 && !is_letter(peek()) && !is_digit(peek())) out_ += '\\';
  out_ += in_[pos_++];
  while (!end() && (static_cast<unsigned char>(peek()) & 0xC0) == 0x80) out_ += in_[pos_++];
  return false;
}

}  // namespace mjsense
