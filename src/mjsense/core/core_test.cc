// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/error.h"
#include "mjsense/core/rng.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/text/json.h"
#include "mjsense/core/text/utf8.h"

namespace mjsense {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Array, RowOfWrongTypeThrows) {
  Array a(DType::kFloat32, {3, 2});
  EXPECT_EQ(a.row<float>(2).size(), 2u);
  EXPECT_THROW(a.row<double>(2), RuntimeError);
  EXPECT_THROW(a.row<std::int32_t>(0), RuntimeError);
  EXPECT_THROW(a.all<std::uint8_t>(), RuntimeError);
  EXPECT_EQ(error_of<RuntimeError>([&] { std::as_const(a).row<double>(0); }),
            "an array (3, 2) of float32 cannot be read as float64");
}

TEST(Array, SharesMemoryIfRowsHaveEqualSize) {
  Array owner(DType::kFloat32, {2, 6});
  const Array same = Array::shared(owner, DType::kInt32, {2, 3, 2});
  EXPECT_EQ(same.data(), owner.data());
  EXPECT_THROW(static_cast<void>(Array::shared(owner, DType::kFloat32, {3, 4})),
               ValueError);  // as many bytes in total, but other rows
  EXPECT_THROW(static_cast<void>(Array::shared(owner, DType::kFloat64, {2, 6})), ValueError);
}

TEST(Array, RowsAreDenseAlignedAndZero) {
  Array a(DType::kFloat32, {3, 2, 5});
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(a.data()) % 64, 0u);
  EXPECT_EQ(a.row<float>(2).data(), a.row<float>(0).data() + 20);
  for (float x : a.all<float>()) EXPECT_EQ(x, 0.0f);
  const ArrayView v = a.view();
  EXPECT_EQ(v.strides[0], 40);
  EXPECT_EQ(v.strides[2], 4);
  EXPECT_EQ(v.shape.str(), "(3, 2, 5)");
}

// A candidate is suggested if at most a third of the letters differ, or one of a short name.
TEST(Errors, SuggestOnlySimilarNames) {
  const auto near = [](const char* name, const char* candidate) {
    return !nearest_names(name, std::vector<std::string>{candidate}).empty();
  };
  EXPECT_TRUE(near("abcdefghi", "abcdefxyz"));
  EXPECT_FALSE(near("abcdefghi", "abcdewxyz"));
  EXPECT_TRUE(near("ab", "ax"));
  EXPECT_FALSE(near("ab", "xy"));
}

TEST(Errors, NameTheNearestCandidates) {
  const std::vector<std::string> names = {"robot/FR_foot", "robot/FL_foot", "terrain",
                                          "robot/trunk"};
  EXPECT_THAT(nearest_names("robot/FR_fot", names), ElementsAre("robot/FR_foot", "robot/FL_foot"));
  EXPECT_THAT(nearest_names("trunk", names), ElementsAre("robot/trunk"));
  EXPECT_THAT(nearest_names("zzz", names), ElementsAre());
  EXPECT_THAT(nearest_names(std::string(8'000'000, 'z'), names), ElementsAre());
  EXPECT_THAT(suggest("zzz", names), HasSubstr("available: robot/FR_foot"));
  try {
    throw_unknown("sensor 'feet'", "geom", "terain", names);
    FAIL();
  } catch (const KeyError& e) {
    EXPECT_STREQ(e.what(), "sensor 'feet': no geom named 'terain'; did you mean 'terrain'?");
  }
}

#ifndef NDEBUG
TEST(ArrayDeathTest, RowOfUnknownWorldAborts) {
  Array rows(DType::kFloat32, {2, 3});
  EXPECT_DEATH(static_cast<void>(rows.row<float>(2)), "the world index is out of range");
  EXPECT_DEATH(static_cast<void>(rows.row_data(-1)), "the world index is out of range");
}
#endif

TEST(Rng, IsIndependentOfOrderAndUniform) {
  Rng a(7, 3, stream_of("imu"), 11), b(7, 3, stream_of("imu"), 11),
      other(7, 4, stream_of("imu"), 11);
  int same = 0;
  for (int i = 0; i < 100; ++i) {
    const auto x = a.next();
    EXPECT_EQ(x, b.next());
    same += x == other.next();
  }
  EXPECT_LT(same, 3);
  double sum = 0, sum2 = 0;
  constexpr int kN = 100000;
  Rng n(1, 0, 0, 0);
  for (int i = 0; i < kN; ++i) {
    const double x = n.normal();
    sum += x;
    sum2 += x * x;
  }
  EXPECT_NEAR(sum / kN, 0.0, 5 / std::sqrt(kN));
  EXPECT_NEAR(sum2 / kN, 1.0, 5 * std::sqrt(2.0 / kN));
}

// Reference vector of Random123's kat_vectors: philox4x32-10, zero key and counter.
TEST(Rng, IsPhilox) {
  Rng rng(0, 0, 0, 0);
  EXPECT_EQ(rng.next(), 0x6627e8d5u);
  EXPECT_EQ(rng.next(), 0xe169c58du);
  EXPECT_EQ(rng.next(), 0xbc57ac4cu);
  EXPECT_EQ(rng.next(), 0x9b00dbd8u);
}

std::string python_float(double x) {
  char text[32];
  return {text, static_cast<std::size_t>(format_python_float(x, text))};
}

TEST(Json, FloatsAsPythonWritesThem) {
  EXPECT_EQ(python_float(1.0), "1.0");
  EXPECT_EQ(python_float(-0.0), "-0.0");
  EXPECT_EQ(python_float(1e-5), "1e-05");
  EXPECT_EQ(python_float(1e-4), "0.0001");
  EXPECT_EQ(python_float(0.1f), "0.10000000149011612");
  EXPECT_EQ(python_float(123456789012345680.0), "1.2345678901234568e+17");
  EXPECT_EQ(python_float(1e15), "1000000000000000.0");
  EXPECT_EQ(python_float(1e16), "1e+16");
  EXPECT_EQ(python_float(1e300), "1e+300");
  EXPECT_EQ(python_float(123.456), "123.456");
  EXPECT_EQ(python_float(std::numeric_limits<double>::infinity()), "Infinity");
  EXPECT_EQ(python_float(std::nan("")), "NaN");
}

TEST(Json, WritesPaddedSortedAsciiRows) {
  std::vector<std::uint8_t> row(64, 255);
  JsonWriter json(row);
  json.begin_object()
      .key("arm")
      .values(std::vector<double>{0.5, -1})
      .key("b\xC3\xA9\xF0\x9F\x98\x80")
      .value(true)
      .end_object();
  ASSERT_TRUE(json.finish());
  EXPECT_EQ(std::string(reinterpret_cast<char*>(row.data())),
            R"({"arm":[0.5,-1.0],"b\u00e9\ud83d\ude00":true})");
  EXPECT_EQ(row.back(), 0);
}

TEST(Json, NumbersThatAreNotFiniteBecomeNullOnRequest) {
  std::vector<std::uint8_t> row(64);
  JsonWriter json(row);
  const double bad[] = {std::nan(""), -std::numeric_limits<double>::infinity(), 1};
  json.finite_only().values(bad);
  ASSERT_TRUE(json.finish());
  EXPECT_STREQ(reinterpret_cast<char*>(row.data()), "[null,null,1.0]");
}

TEST(Json, WritesWholeNumbersOfEitherSign) {
  std::vector<std::uint8_t> row(64);
  JsonWriter json(row);
  json.begin_array().value(std::uint64_t{1} << 63).value(std::int64_t{-5}).end_array();
  ASSERT_TRUE(json.finish());
  EXPECT_STREQ(reinterpret_cast<char*>(row.data()), "[9223372036854775808,-5]");
}

// Overlong forms, half a surrogate pair, code points beyond U+10FFFF, and incomplete characters.
TEST(Json, InvalidUtf8IsReplaced) {
  for (const char* text :
       {"\xC0\x80", "\xE0\x80\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xC3", "\xFF"}) {
    std::vector<std::uint8_t> row(64);
    JsonWriter json(row);
    json.value(text);
    ASSERT_TRUE(json.finish());
    std::string expected = "\"";
    for (std::size_t i = 0; i < std::string_view(text).size(); ++i) expected += "\\ufffd";
    EXPECT_EQ(reinterpret_cast<char*>(row.data()), expected + "\"");
  }
}

TEST(Json, ReportsTextThatDoesNotFit) {
  std::vector<std::uint8_t> row(8);
  JsonWriter json(row);
  json.begin_object().key("long name").value(1).end_object();
  EXPECT_FALSE(json.finish());
  EXPECT_EQ(json.size(), 15u);
  JsonWriter unsorted(row);
  unsorted.begin_object().key("b").value(1);
  EXPECT_THROW(unsorted.key("a"), std::logic_error);
}

TEST(ThreadPool, RunsEveryItemOnceAndReportsTheFirstFailure) {
  for (int threads : {1, 2, 5}) {
    ThreadPool pool(threads);
    for (int repeat = 0; repeat < 50; ++repeat) {
      std::vector<std::atomic<int>> hits(37);
      pool.run(37, [&](int i, int) { ++hits[i]; });
      for (auto& h : hits) EXPECT_EQ(h, 1);
    }
    EXPECT_THROW(pool.run(9,
                          [](int i, int) {
                            if (i % 4 == 3) throw RuntimeError(std::to_string(i));
                          }),
                 RuntimeError);
    try {
      pool.run(9, [](int i, int) {
        if (i % 4 == 3) throw RuntimeError(std::to_string(i));
      });
    } catch (const RuntimeError& e) {
      EXPECT_STREQ(e.what(), "3");
    }
  }
}

TEST(Utf8, SizeOfTheFirstCharacter) {
  EXPECT_EQ(utf8_size("a"), 1u);
  EXPECT_EQ(utf8_size("\u00e9x"), 2u);
  EXPECT_EQ(utf8_size("\u20acx"), 3u);
  EXPECT_EQ(utf8_size("\U0001f600x"), 4u);
  // No continuation, truncated, overlong, a surrogate, beyond U+10FFFF, a continuation first.
  for (const char* text :
       {"\xC3x", "\xE2\x82x", "\xE2x\xAC", "\xF0\x9F\x98x", "\xE2\x82", "\xC0\x80", "\xE0\x80\x80",
        "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xF5\x80\x80\x80", "\x80"})
    EXPECT_EQ(utf8_size(text), 0u) << text;
}

}  // namespace
}  // namespace mjsense
