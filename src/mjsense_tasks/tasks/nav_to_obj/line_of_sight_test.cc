// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/nav_to_obj/line_of_sight.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "mjsense/core/testing/test_model.h"

namespace mjsense::tasks {
namespace {

constexpr double kDeg = std::numbers::pi / 180;

// A camera at the origin that looks along x with z up, a vertical field of view of 60 degrees, a
// 4:3 image, and a ball 2 m away.
struct Sighting : ::testing::Test {
  // Moves the ball to this direction: degrees to the left of and above the camera's axis.
  bool sees(double left, double up) {
    return sees_at({2, 2 * std::tan(left * kDeg), 2 * std::tan(up * kDeg)});
  }
  bool sees_at(Vec3 ball) {
    write_vec(ball, data->qpos);
    mj_forward(model.get(), data.get());
    const Vec3 middle[] = {{0, 0, 0}};
    return sight.sees(model.get(), data.get(), sight.pose(data.get()), 1, middle);
  }
  ModelPtr model = compile_mjcf(R"(<mujoco><worldbody>
      <camera name="eye" fovy="60" xyaxes="0 -1 0 0 0 1"/>
      <body name="ball"><freejoint/><geom size=".05"/></body>
      <body name="screen" pos="0 0 -9"><freejoint/><geom type="box" size=".01 .2 .2"/></body>
      </worldbody></mujoco>)");
  DataPtr data = make_data(model.get());
  LineOfSight sight{model.get(), 0, 4, 3};
};

TEST_F(Sighting, EndsAtEveryBorderOfTheImage) {
  const double wide = std::atan(4.0 / 3 * std::tan(30 * kDeg)) / kDeg;
  EXPECT_TRUE(sees(0, 0));
  for (const int sign : {1, -1}) {
    EXPECT_TRUE(sees(0, sign * 29)) << sign;
    EXPECT_FALSE(sees(0, sign * 31)) << sign;
    EXPECT_TRUE(sees(sign * (wide - 1), 0)) << sign;
    EXPECT_FALSE(sees(sign * (wide + 1), 0)) << sign;
  }
  EXPECT_FALSE(sees_at({-2, 0, 0})) << "behind the camera";
}

TEST_F(Sighting, EndsAtOccludingGeoms) {
  write_vec({1, 0, 0}, data->qpos + 7);
  EXPECT_FALSE(sees(0, 0));
  EXPECT_TRUE(sees(20, 0)) << "past the screen";
}

}  // namespace
}  // namespace mjsense::tasks
