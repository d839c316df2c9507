#include "mjsense/core/python_regex.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "mjsense/core/pattern_characters.h"

namespace mjsense {
namespace {

// What a quantifier after the last item would repeat.
enum class Item { kNone, kOne, kRepeat };

class Translator : private PatternCharacters {
 public:
  using PatternCharacters::PatternCharacters;

  PcrePattern run() {
    alternatives(false);
    if (!end()) fail("unbalanced parenthesis");
    if (highest_condition_ > groups_) {
      fail(fmt::format("invalid group reference {}", highest_condition_));
    }
    return {std::move(out_), ascii_};
  }

 private:
  void alternatives(bool verbose) {
    sequence(verbose);
    while (!end() && peek() == '|') {
      out_ += in_[pos_++];
      sequence(verbose);
    }
  }

  // Up to the end, a '|' or a ')'. `verbose` may be switched on by a flag at the start of the
  // pattern.
  void sequence(bool& verbose) {
    Item last = Item::kNone;
    while (!end() && peek() != '|' && peek() != ')') {
      const char c = peek();
      if (verbose && (c == ' ' || (c >= '\t' && c <= '\r'))) {
        ++pos_;
      } else if (verbose && c == '#') {
        while (!end() && peek() != '\n') ++pos_;
      } else if (c == '*' || c == '+' || c == '?' || c == '{') {
        quantifier(last);
      } else if (c == '(') {
        group(last, verbose);
      } else if (c == '[') {
        set();
        last = Item::kOne;
      } else if (c == '\\') {
        last = escape() ? Item::kOne : Item::kNone;
      } else if (c == '^' || c == '$') {
        out_ += in_[pos_++];
        last = Item::kNone;  // an anchor cannot be repeated
      } else {
        out_ += in_[pos_++];
        while (!end() && (static_cast<unsigned char>(peek()) & 0xC0) == 0x80) out_ += in_[pos_++];
        last = Item::kOne;
      }
    }
  }

  void quantifier(Item& last) {
    const std::size_t start = pos_;
    std::string text(1, in_[pos_++]);
    if (text == "{") {
      std::string low, high;
      if (peek() == '}') {  // literal
        out_ += "\\{";
        last = Item::kOne;
        return;
      }
      while (is_digit(peek())) low += in_[pos_++];
      const bool comma = peek() == ',';
      if (comma) {
        ++pos_;
        while (is_digit(peek())) high += in_[pos_++];
      }
      if (peek() != '}') {
        pos_ = start + 1;
        out_ += "\\{";
        last = Item::kOne;
        return;
      }
      ++pos_;
      if (!comma) high = low;
      if (low.size() > 5 || high.size() > 5) fail("the repetition number is too large");
      if (!low.empty() && !high.empty() && std::stoi(low) > std::stoi(high))
        fail("min repeat greater than max repeat");
      text = fmt::format("{{{},{}}}", low.empty() ? "0" : low, high);
    }
    if (last == Item::kNone) {
      pos_ = start;
      fail("nothing to repeat");
    }
    if (last == Item::kRepeat) {
      pos_ = start;
      fail("multiple repeat");
    }
    out_ += text;
    if (peek() == '?' || peek() == '+') out_ += in_[pos_++];
    last = Item::kRepeat;
  }

  void group(Item& last, bool& verbose) {
    const std::size_t start = pos_;
    ++pos_;
    if (peek() == '*') {
      fail("nothing to repeat");
    }
    bool inner_verbose = verbose;
    int number = 0;
    if (peek() != '?') {
      number = open_group("");
      out_ += '(';
    } else {
      ++pos_;
      if (take("#")) {
        while (!end() && peek() != ')') ++pos_;
        if (!take(")")) fail("missing ), unterminated comment");
        return;
      }
      if (take("P<")) {
        const std::string name = group_name('>');
        if (names_.count(name)) fail("redefinition of group name '" + name + "'");
        number = open_group(name);
        out_ += "(?P<" + name + ">";
      } else if (take("P=")) {
        const std::string name = group_name(')');
        const auto known = names_.find(name);
        if (known == names_.end()) fail("unknown group name '" + name + "'");
        if (open_.count(known->second)) fail("cannot refer to an open group");
        out_ += "(?P=" + name + ")";
        last = Item::kOne;
        return;
      } else if (take("(")) {
        condition();
      } else if (take("<=") || take("<!") || take("=") || take("!") || take(":") || take(">")) {
        out_ += '(';
        out_ += in_.substr(start + 1, pos_ - start - 1);
      } else if (!flags(start, verbose, inner_verbose)) {
        return;  // (?i) for the whole pattern
      }
    }
    alternatives(inner_verbose);
    if (!take(")")) {
      pos_ = start;
      fail("missing ), unterminated subpattern");
    }
    out_ += ')';
    if (number > 0) open_.erase(number);
    last = Item::kOne;
  }

  int open_group(const std::string& name) {
    ++groups_;
    if (!name.empty()) names_.emplace(name, groups_);
    open_.insert(groups_);
    return groups_;
  }

  std::string group_name(char stop) {
    std::string name;
    while (!end() && peek() != stop) name += in_[pos_++];
    if (!take(std::string_view(&stop, 1))) fail("missing the end of a group name");
    if (name.empty()) fail("missing group name");
    for (std::size_t i = 0; i < name.size(); ++i) {
      const char c = name[i];
      if (!(is_letter(c) || c == '_' || (c & 0x80) || (i > 0 && is_digit(c))))
        fail("bad character in group name '" + name + "'");
    }
    return name;
  }

  void condition() {
    std::string name;
    while (!end() && peek() != ')') name += in_[pos_++];
    if (!take(")")) fail("missing )");
    const bool number = !name.empty() && name.find_first_not_of("0123456789") == std::string::npos;
    if (number) {
      if (name.size() > 3 || std::stoi(name) == 0) fail("invalid group reference " + name);
      highest_condition_ =
          std::max(highest_condition_, std::stoi(name));  // may be of a later group
      out_ += "(?(" + name + ")";
    } else {
      if (!names_.count(name)) fail("unknown group name '" + name + "'");
      out_ += "(?(<" + name + ">)";
    }
  }

  // After "(?". True if a group follows: its head is written.
  bool flags(std::size_t start, bool& verbose, bool& inner_verbose) {
    std::string on, off;
    while (is_letter(peek())) on += in_[pos_++];
    if (take("-")) {
      while (is_letter(peek())) off += in_[pos_++];
      if (off.empty() || off.find_first_of("aLu") != std::string::npos) fail("bad inline flags");
    }
    if (on.empty() && off.empty()) fail("unknown extension");
    if ((on + off).find_first_not_of("aimsux") != std::string::npos)
      fail("unknown extension or flag");
    if (on.find_first_of(off) != std::string::npos)
      fail("bad inline flags: flag turned on and off");
    const bool ascii = on.find('a') != std::string::npos;
    if (ascii && on.find('u') != std::string::npos)
      fail("bad inline flags: 'a' and 'u' are incompatible");
    std::string known_on, known_off;
    for (char c : on) {
      if (c != 'a' && c != 'u' && c != 'x') known_on += c;
    }
    for (char c : off) {
      if (c != 'x') known_off += c;
    }
    const std::string head = "(?" + known_on + (known_off.empty() ? "" : "-" + known_off);
    if (take(")")) {
      if (!off.empty()) fail("missing :");
      if (start != global_end_) fail("global flags not at the start of the expression");
      global_end_ = pos_;
      ascii_ |= ascii;
      verbose |= on.find('x') != std::string::npos;
      if (!known_on.empty()) out_ += head + ")";
      return false;
    }
    if (!take(":")) fail("unknown extension or flag");
    if (ascii) fail("(?a:...) is not supported; use (?a) for the whole pattern");
    if (on.find('x') != std::string::npos) inner_verbose = true;
    if (off.find('x') != std::string::npos) inner_verbose = false;
    out_ += head + ":";
    return true;
  }

  // False for an anchor, which cannot be repeated.
  bool escape() {
    ++pos_;
    if (end()) fail("bad escape (end of pattern)");
    std::uint32_t value = 0;
    const char c = peek();
    if (character_escape(value)) {
      out_ += code_point(value);
    } else if (c == 'A' || c == 'b' || c == 'B' || c == 'Z') {
      ++pos_;
      out_ += c == 'Z' ? "\\z" : std::string("\\") + c;
      return false;
    } else if (std::string_view("dDwW").find(c) != std::string_view::npos) {
      ++pos_;
      out_ += std::string("\\") + c;
    } else if (c == 's' || c == 'S') {
      ++pos_;
      out_ += space(c == 'S', false);
    } else if (c == '0') {
      for (int i = 0; i < 3 && is_octal(peek()); ++i) value = 8 * value + (in_[pos_++] - '0');
      out_ += code_point(value);
    } else if (is_digit(c)) {
      reference();
    } else {
      literal_escape();
    }
    return true;
  }

  void reference() {
    if (is_octal(peek()) && is_octal(peek(1)) && is_octal(peek(2)) && is_digit(peek(1))) {
      const std::uint32_t value = 64 * (peek() - '0') + 8 * (peek(1) - '0') + (peek(2) - '0');
      if (value > 0377) fail("octal escape outside of range 0-0o377");
      pos_ += 3;
      out_ += code_point(value);
      return;
    }
    int number = in_[pos_++] - '0';
    if (is_digit(peek())) number = 10 * number + (in_[pos_++] - '0');
    if (number > groups_) fail(fmt::format("invalid group reference {}", number));
    if (open_.count(number)) fail("cannot refer to an open group");
    out_ += fmt::format("\\g{{{}}}", number);
  }

  std::size_t global_end_ = 0;  // end of the flags at the start of the pattern
  int groups_ = 0;
  int highest_condition_ = 0;
  std::map<std::string, int> names_;
  std::set<int> open_;
};

}  // namespace

PcrePattern translate_python_regex(std::string_view pattern) { return Translator(pattern).run(); }

}  // namespace mjsense
