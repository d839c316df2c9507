// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/pick_and_place/support_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "mjsense/core/testing/test_model.h"

namespace mjsense::tasks {
namespace {

// A table, a tray on it, and a block of 0.2 kg; seen from the side:
//
//          block
//     _______________
//    |     tray      |
//   =====================  table, its top at z = 0
struct Support : ::testing::Test {
  static constexpr const char* kModel = R"(<mujoco><worldbody>
    <body name="table" pos="0 0 -0.05"><geom type="box" size="1 1 0.05"/></body>
    <body name="tray" pos="0 0 0.01"><freejoint/><geom type="box" size="0.1 0.1 0.01" mass="0.5"/></body>
    <body name="block" pos="0 0 0.5"><freejoint/><geom type="box" size="0.03 0.03 0.03" mass="0.2"/></body>
    <body name="wall" pos="-0.5 0 0.2"><geom type="box" size="0.01 0.5 0.2"/></body>
  </worldbody></mujoco>)";
  // Places the block and simulates until it is at rest; `push`: constant force along x, N.
  void put(double x, double y, double z, double push = 0, int steps = 1000) {
    mj_resetData(model.get(), data.get());
    double* q = data->qpos + 7;
    q[0] = x, q[1] = y, q[2] = z;
    data->xfrc_applied[6 * kBlock] = push;
    for (int i = 0; i < steps; ++i) mj_step(model.get(), data.get());
    mj_forward(model.get(), data.get());
  }
  static constexpr int kTable = 1, kTray = 2, kBlock = 3, kWall = 4;
  ModelPtr model = compile_mjcf(kModel);
  DataPtr data = make_data(model.get());
  World world{.id = 0, .model = model.get(), .data = data.get()};
};

// A block with half extents of 2 x 3 x 4 cm, rotated by 90 and by 30 degrees. The half extents of
// its axis-aligned box are |R| times these.
TEST_F(Support, BoundingBoxOfARotatedBlock) {
  put(0.5, 0, 0.2, 0, 0);
  for (int i = 0; i < 3; ++i)
    model->geom_aabb[6 * model->body_geomadr[kBlock] + 3 + i] = 0.02 + 0.01 * i;
  for (const double degrees : {0.0, 90.0, 30.0}) {
    const double a = degrees * M_PI / 180, c = std::abs(std::cos(a)), s = std::abs(std::sin(a));
    const Aabb box = turned_box(world, kBlock, axis_angle({0, 0, 1}, a));
    EXPECT_NEAR(box.high.x - box.low.x, 2 * (0.02 * c + 0.03 * s), 1e-9) << degrees;
    EXPECT_NEAR(box.high.y - box.low.y, 2 * (0.02 * s + 0.03 * c), 1e-9) << degrees;
    EXPECT_NEAR(box.high.z - box.low.z, 0.08, 1e-9) << degrees;
    EXPECT_NEAR(box.center().x, 0.5, 1e-9) << degrees;
  }
}

TEST_F(Support, TraySupportsABlock) {
  put(0, 0, 0.05);
  const Vec3 force = contact_force(world, kTray, kBlock);
  EXPECT_NEAR(force.z, 0.2 * 9.81, 0.02);
  EXPECT_NEAR(contact_force(world, kBlock, kTray).z, -0.2 * 9.81, 0.02) << "and is pressed down";
  EXPECT_TRUE(bears(world, force, kBlock));
  EXPECT_TRUE(carries(world, kTray, kBlock));
  EXPECT_EQ(supporting_body(world, kBlock), kTray);
  EXPECT_EQ(supporting_body(world, kTray), kTable);
  EXPECT_FALSE(carries(world, kTable, kBlock));
  EXPECT_FALSE(carries(world, kBlock, kTray));
  EXPECT_TRUE(touched_by(world, kBlock, kTray));
  EXPECT_FALSE(touched_by(world, kBlock, kTable));
}

TEST_F(Support, TableSupportsABlockNextToTheTray) {
  put(0.2, 0, 0.03);
  EXPECT_FALSE(carries(world, kTray, kBlock));
  EXPECT_TRUE(carries(world, kTable, kBlock));
  EXPECT_EQ(supporting_body(world, kBlock), kTable);
}

// The block is pressed against a wall and held by friction. The wall's force is not vertical.
TEST_F(Support, WallDoesNotSupport) {
  put(-0.459, 0, 0.2, -60);
  const Vec3 force = contact_force(world, kWall, kBlock);
  ASSERT_GT(force.x, 30);
  EXPECT_GT(force.z, 1.0) << "it does hold it up";
  EXPECT_FALSE(bears(world, force, kBlock));
  EXPECT_FALSE(carries(world, kWall, kBlock));
}

// A force supports the block if it is within 30 degrees of up and at least half of the block's
// weight.
TEST_F(Support, ForcesAreTestedByAngleAndSize) {
  put(0.5, 0, 0.2, 0, 0);
  const auto force = [](double degrees, double size) {
    const double a = degrees * M_PI / 180;
    return Vec3{size * std::sin(a), 0, size * std::cos(a)};
  };
  EXPECT_TRUE(bears(world, force(29, 10), kBlock));
  EXPECT_TRUE(bears(world, force(-29, 10), kBlock));
  EXPECT_FALSE(bears(world, force(31, 10), kBlock));
  EXPECT_FALSE(bears(world, force(180, 10), kBlock));
  const double weight = 0.2 * 9.81;
  EXPECT_TRUE(bears(world, force(0, 0.51 * weight), kBlock));
  EXPECT_FALSE(bears(world, force(0, 0.49 * weight), kBlock));
}

// The block lies on the table, which is tilted about y.
TEST_F(Support, WithoutForcesTheNormalMustBeWithinThirtyDegreesOfUp) {
  for (const double degrees : {29.0, 31.0}) {
    const Quat tilt = axis_angle({0, 1, 0}, degrees * M_PI / 180);
    write_quat(tilt, model->body_quat + 4 * kTable);
    put(0.5, 0, 0.2, 0, 0);
    const Pose block{vec3(model->body_pos + 3 * kTable) + rotate(tilt, {0.5, 0, 0.0795}), tilt};
    write_pose(block, data->qpos + 7);
    data->qpos[0] = 50;  // the tray is elsewhere
    mj_forward(model.get(), data.get());
    EXPECT_EQ(likely_supports(world, kTable, kBlock), degrees < 30) << degrees;
  }
}

// No contact forces have been computed, or there is a small gap between the two.
TEST_F(Support, WithoutForcesBoundingBoxesAreUsed) {
  put(0, 0, 0.02 + 0.03 + 0.005, 0, 0);
  EXPECT_EQ(norm(contact_force(world, kTray, kBlock)), 0);
  EXPECT_TRUE(likely_supports(world, kTray, kBlock));
  put(0, 0, 0.02 + 0.03 + 0.011, 0, 0);
  EXPECT_FALSE(likely_supports(world, kTray, kBlock)) << "more than 1 cm above";
  put(0.1 - 0.001, 0, 0.055, 0, 0);
  EXPECT_TRUE(likely_supports(world, kTray, kBlock)) << "more than half of it over the tray";
  put(0.1 + 0.001, 0, 0.055, 0, 0);
  EXPECT_FALSE(likely_supports(world, kTray, kBlock));
}

TEST_F(Support, GapsBetweenBoxes) {
  put(0.2, 0.05, 0.03, 0, 0);
  const Aabb a = world_box(world, kTray), b = world_box(world, kBlock);
  EXPECT_NEAR(b.low.x, 0.17, 1e-12);
  EXPECT_NEAR(a.high.z, 0.02, 1e-12);
  EXPECT_NEAR(gap_from_above(a, b), 0.07, 1e-12);
  const Aabb corner{{0.13, 0.14, 0}, {0.2, 0.2, 1}};
  EXPECT_NEAR(gap_from_above(a, corner), 0.05, 1e-12) << "3, 4, 5";
  const Aabb over{{0.08, 0, 5}, {0.3, 0.1, 6}};
  EXPECT_NEAR(gap_from_above(a, over), -0.02, 1e-12);
}

// Objects of 6 cm on the table, over its edge at x = 1, on the tray, and partly on the tray.
TEST_F(Support, SurfaceMustBeUnderTheWholeObject) {
  put(0.5, 0, 0.03);
  const Vec3 half{0.03, 0.03, 0.03};
  const auto carried = [&](Vec3 at, int carrier) {
    return is_supported_over_whole_area(world, at, half, carrier, kBlock);
  };
  const double tray = data->xpos[3 * kTray + 2] + 0.01;
  EXPECT_TRUE(carried({0.3, 0.2, 0}, kTable));
  EXPECT_TRUE(carried({0.5, 0, 0}, kTable)) << "it stands there itself";
  EXPECT_TRUE(carried({0.96, 0, 0}, kTable));
  EXPECT_FALSE(carried({0.98, 0, 0}, kTable));
  EXPECT_FALSE(carried({0.3, 0.2, 0.03}, kTable)) << "in the air";
  EXPECT_FALSE(carried({0.3, 0.2, -0.03}, kTable)) << "in the table";
  EXPECT_TRUE(carried({0, 0, tray}, kTray));
  EXPECT_FALSE(carried({0, 0, tray}, kTable));
  EXPECT_FALSE(carried({0.09, 0, tray}, kTray));
  EXPECT_FALSE(carried({0.12, 0, 0}, kTable)) << "half on the tray";
}

}  // namespace
}  // namespace mjsense::tasks
