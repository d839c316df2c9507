// SPDX-License-Identifier: Apache-2.0
#include "mjsense/replay/json_text.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "mjsense/hdf5/lzf.h"

namespace mjsense::replay {
namespace {

TEST(JsonText, AcceptsWhatPythonWrites) {
  for (const char* text : {"{}", "[]", "{\"a\":[1,-0.0,1e-05,1.0],\"b\":{\"c\":null}}",
                           "{\"x\":NaN,\"y\":Infinity,\"z\":-Infinity}", " {\"a\" : true} ",
                           "\"\\u00e9\\n\"", "1e400", "0", "-0", "[0.5,1E+2,10,-0e0]"}) {
    EXPECT_EQ(parse_json(text), "") << text;
  }
}

TEST(JsonText, ReportsThePositionOfAnError) {
  EXPECT_EQ(parse_json(""), "byte 0: expected a value");
  EXPECT_EQ(parse_json("{\"a\":[1,2"), "byte 9: expected ',' or ']'");
  EXPECT_EQ(parse_json("{\"a\" 1}"), "byte 5: expected ':'");
  EXPECT_EQ(parse_json("{\"a\":1} x"), "byte 8: expected the end");
  for (const char* text : {"{\"a\":}", "{a:1}",     "[1,]", "{\"a\":1,}", "nan", "inf",  "+1",
                           "\"\\x\"",  "\"\\u12\"", "[",    "tru",        "00",  "-01",  "1.",
                           ".5",       "-",         "1e",   "1e+",        "0x1", "1.e3", "-inf"}) {
    EXPECT_NE(parse_json(text), "") << text;
  }
  EXPECT_NE(parse_json(std::string(1000, '[')), "");
}

TEST(JsonText, EveryPrefixOfARowIsInvalid) {
  const std::string row =
      "{\"arm\":[0.1,-2.5e-3,Infinity],\"gripper\":{\"held\":true,\"name\":\"a\\u00e9\"}}";
  ASSERT_EQ(parse_json(row), "");
  for (std::size_t n = 0; n < row.size(); ++n) EXPECT_NE(parse_json(row.substr(0, n)), "") << n;
}

TEST(JsonText, VisitsNumbersWithTheirPaths) {
  std::map<std::string, std::vector<double>> seen;
  ASSERT_EQ(parse_json("{\"arm\":[1,2.5],\"g\":{\"held\":true},\"n\":NaN}",
                       [&](const std::string& path, double x) { seen[path].push_back(x); }),
            "");
  EXPECT_EQ(seen["arm"], (std::vector<double>{1, 2.5}));
  EXPECT_EQ(seen["g/held"], (std::vector<double>{1}));
  EXPECT_TRUE(std::isnan(seen["n"].at(0)));
}

TEST(JsonText, NumbersBeyondDoubleEqualPython) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const std::string tiny = "0." + std::string(400, '0') + "1", huge(400, '9');
  for (const auto& [text, expected] : std::map<std::string, double>{{"1e400", kInfinity},
                                                                    {"-1E400", -kInfinity},
                                                                    {"1e-400", 0},
                                                                    {"-0.5", -0.5},
                                                                    {tiny, 0},
                                                                    {huge, kInfinity}}) {
    double value = 1;
    ASSERT_EQ(parse_json(text, [&](const std::string&, double x) { value = x; }), "") << text;
    EXPECT_EQ(value, expected) << text;
  }
}

TEST(Lzf, UnpacksRunsAndReferences) {
  // "abc", then 7 bytes from offset -3 (overlapping), then "!".
  const std::vector<std::uint8_t> packed = {2, 'a', 'b', 'c', 5 << 5, 2, 0, '!'};
  std::vector<std::uint8_t> out(32);
  ASSERT_EQ(hdf5::lzf_unpack(packed, out), 11u);
  EXPECT_EQ(std::string(out.begin(), out.begin() + 11), "abcabcabca!");
  // A long back reference: 7 + 20 + 2 bytes.
  const std::vector<std::uint8_t> lengthy = {0, 'z', 7 << 5, 20, 0};
  EXPECT_EQ(hdf5::lzf_unpack(lengthy, out), 30u);
}

TEST(Lzf, RejectsCorruptInput) {
  std::vector<std::uint8_t> out(8);
  // literal run beyond the end of the input
  EXPECT_EQ(hdf5::lzf_unpack(std::vector<std::uint8_t>{5, 'a'}, out), 0u);
  EXPECT_EQ(hdf5::lzf_unpack(std::vector<std::uint8_t>{0, 'a', 1 << 5, 9}, out),
            0u);  // reference before the beginning of the output
  EXPECT_EQ(hdf5::lzf_unpack(std::vector<std::uint8_t>{0, 'a', 6 << 5, 0, 0, 'b'},
                             std::span(out).first(4)),
            0u);  // output buffer too small
}

}  // namespace
}  // namespace mjsense::replay
