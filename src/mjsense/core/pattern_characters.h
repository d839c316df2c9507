#pragma once
// Reading a Python regular expression character by character: escapes and sets, written in PCRE2's syntax. The structure
// above them is python_regex.cc's.

#include <cstdint>
#include <string>
#include <string_view>

namespace mjsense {

inline bool is_digit(char c) { return c >= '0' && c <= '9'; }
inline bool is_octal(char c) { return c >= '0' && c <= '7'; }
inline bool is_letter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

// A character by its number, in PCRE2's syntax.
std::string code_point(std::uint32_t c);

class PatternCharacters {
 public:
  explicit PatternCharacters(std::string_view pattern) : in_(pattern) {}

 protected:
  bool end() const { return pos_ >= in_.size(); }
  char peek(std::size_t ahead = 0) const {
    return pos_ + ahead < in_.size() ? in_[pos_ + ahead] : '\0';
  }
  bool take(std::string_view text);
  [[noreturn]] void fail(std::string_view what) const;

  // After a backslash, a character that means the same in and outside of a set; false: another escape, nothing taken.
  bool character_escape(std::uint32_t& value);
  // After a backslash, a character that stands for itself.
  void literal_escape();
  // \s or \S.
  std::string space(bool negated, bool in_set) const;
  // A set, from its "[" on.
  void set();

  std::string_view in_;
  std::size_t pos_ = 0;
  std::string out_;
  bool ascii_ = false;  // (?a)

 private:
  bool set_item();
  std::uint32_t hex(int digits, char letter);
};

}  // namespace mjsense
