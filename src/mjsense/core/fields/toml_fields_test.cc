// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/toml_fields.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "mjsense/core/error.h"

namespace mjsense {
namespace toml_fields_test {

struct Cfg {
  int seed = 0;
  std::string task = "pick";
};
template <class V>
void visit_fields(V& v, Cfg& c) {
  v.object("Cfg", "Two fields.");
  v("seed", c.seed, "A number.");
  v("task", c.task, "A text.");
}

// toml++ 3.3 assumes that there are no letters beyond ASCII outside of strings. This tests all of
// them: Unicode spaces are spaces, and no other letter can be part of a key.
TEST(TomlFields, LettersBeyondAscii) {
  const std::set<int> spaces = {0xA0,   0x1680, 0x180E, 0x202F, 0x205F, 0x2060,
                                0x3000, 0x85,   0x2028, 0x2029, 0xFEFF};
  for (int c = 0x80; c < 0x10000; ++c) {
    if (c >= 0xD800 && c < 0xE000) continue;
    std::string letter;
    if (c >= 0x800) letter += static_cast<char>(0xE0 | c >> 12);
    letter += static_cast<char>(c >= 0x800 ? 0x80 | (c >> 6 & 0x3F) : 0xC0 | c >> 6);
    letter += static_cast<char>(0x80 | (c & 0x3F));
    const bool space = spaces.contains(c) || (c >= 0x2000 && c <= 0x200B);
    Cfg cfg;
    const auto parse = [&] {
      read_toml_fields("seed = 1\n" + letter + "task = 'place'", "x", cfg);
    };
    if (space) {
      try {
        parse();
      } catch (const ValueError&) {
      }
    } else {
      EXPECT_THROW(parse(), ValueError) << c;
      EXPECT_EQ(cfg.task, Cfg().task) << c;
    }
  }
}

// toml++ 3.3 asserts that some of these cannot occur.
TEST(TomlFields, InvalidHeadersAreErrors) {
  for (const std::string header :
       {"+a",   "[+a",    "=", "#",  ".",        ".a",  "a.", "a.+", "a..b",
        ",",    "{",      "'", "\"", "''' a'''", " ",   "\n", "\r",  "\x01",
        "\x7f", "\u00e9", "[", "[[", "a",        "a b", "[a]"}) {
    Cfg cfg;
    EXPECT_THROW(read_toml_fields("seed = 1\n[" + header, "x", cfg), ValueError) << header;
  }
}

}  // namespace toml_fields_test
}  // namespace mjsense
