// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/json_rows.h"

#include <gtest/gtest.h>

#include <limits>

#include "mjsense/core/error.h"
#include "mjsense/record/testing/tools.h"

namespace mjsense::record {
namespace {

struct Numbers final : Sensor {
  explicit Numbers(std::string name) : Sensor(std::move(name)) {}
  std::string_view kind() const override { return "numbers"; }
  void initialize(const SensorInit&) override {}
  void compute(const World&) override {}

  template <class T>
  Numbers& add(std::string_view field, Shape shape, std::initializer_list<T> values) {
    SensorSpec spec;
    spec.dtype = dtype_of<T>();
    spec.shape = shape;
    const auto row = add_field(field, spec, 2).data.template row<T>(1);
    std::copy(values.begin(), values.end(), row.begin());
    return *this;
  }
};

// The text of world 1.
std::string text_of_row(const JsonRows& rows) {
  std::vector<std::uint8_t> kept(rows.row_bytes(), 0xEE), text(200, 0xEE);
  rows.copy(1, kept.data());
  rows.write(kept.data(), text);
  const std::string all(text.begin(), text.end());
  const std::size_t end = all.find('\0');
  EXPECT_EQ(all.find_first_not_of('\0', end), std::string::npos) << "not padded with 0";
  return all.substr(0, end);
}

TEST(JsonRows, MembersAreSortedAndWidened) {
  Numbers sensor("qpos");
  sensor.add<float>("base", {0}, {});
  sensor.add<float>("arm", {2}, {0.05f, -1e-5f});
  sensor.add<double>("a/b", {1}, {0.05});
  EXPECT_EQ(text_of_row(JsonRows(sensor, 200)),
            R"({"a":{"b":[0.05]},"arm":[0.05000000074505806,-9.999999747378752e-06],"base":[]})");
}

TEST(JsonRows, OmitFieldsThatAreNotGiven) {
  Numbers sensor("actions/x");
  sensor.add<double>("arm", {2}, {0, 0}).add<double>("base", {0}, {});
  sensor.add<double>("gripper", {1}, {255});
  sensor.add<bool>("given/arm", {}, {false}).add<bool>("given/base", {}, {true});
  const JsonRows rows(sensor, 200);
  EXPECT_EQ(text_of_row(rows), R"({"base":[],"gripper":[255.0]})");
  sensor.fields()[3].data.row<bool>(1)[0] = true;
  sensor.fields()[4].data.row<bool>(1)[0] = false;
  EXPECT_EQ(text_of_row(rows), R"({"arm":[0.0,0.0],"gripper":[255.0]})");
}

TEST(JsonRows, NestByThePathOfAField) {
  Numbers sensor("grasp_state_cup");
  sensor.add<bool>("right/touching", {}, {true}).add<bool>("left/held", {}, {false});
  sensor.add<std::int32_t>("left-most", {}, {-3}).add<bool>("left/touching", {}, {true});
  sensor.add<bool>("right/deep/er", {}, {true});
  EXPECT_EQ(text_of_row(JsonRows(sensor, 300)),
            R"({"left":{"held":false,"touching":true},"left-most":-3,)"
            R"("right":{"deep":{"er":true},"touching":true}})");
}

TEST(JsonRows, EqualPythonsJson) {
  Numbers sensor("qpos");
  constexpr double kInf = std::numeric_limits<double>::infinity();
  sensor.add<double>("x", {4}, {kInf, -kInf, std::numeric_limits<double>::quiet_NaN(), -0.0});
  sensor.add<std::uint8_t>("y", {2}, {0, 255}).add<std::int64_t>("z", {}, {-(1ll << 62)});
  EXPECT_EQ(text_of_row(JsonRows(sensor, 300)),
            R"({"x":[Infinity,-Infinity,NaN,-0.0],"y":[0,255],"z":-4611686018427387904})");
}

TEST(JsonRows, LongestTextMustFit) {
  Numbers sensor("qpos");
  constexpr double kLong = -1.2345678901234567e-123;
  sensor.add<double>("arm", {2}, {kLong, kLong}).add<bool>("hand/held", {}, {false});
  const std::string text = text_of_row(JsonRows(sensor, 200));
  const std::string error = error_of([&] { JsonRows(sensor, 40); });
  EXPECT_EQ(error, "sensor 'qpos': its text can need 108 bytes; its rows have 40");
  EXPECT_LE(text.size(), 108u);
}

TEST(JsonRows, ArraysCannotContainFields) {
  Numbers sensor("qpos");
  sensor.add<double>("arm/tip", {1}, {0}).add<double>("arm", {1}, {0});
  EXPECT_EQ(error_of([&] { JsonRows(sensor, 200); }),
            "sensor 'qpos': the JSON of field 'arm' would contain that of field 'arm/tip'; rename "
            "one of them");
}

}  // namespace
}  // namespace mjsense::record
