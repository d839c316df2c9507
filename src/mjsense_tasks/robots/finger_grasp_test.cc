// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/finger_grasp.h"

#include <gtest/gtest.h>

#include <utility>

#include "mjsense/observe/testing/world.h"

namespace mjsense::tasks::robots {
namespace {

// Two fingers with pads that face each other along y, 4 cm apart; a box with a child body, the
// knob; and a wall.
constexpr char kScene[] = R"(
<mujoco>
  <option gravity="0 0 0"/>
  <worldbody>
    <body name="hand">
      <body name="left" pos="0 .03 0"><geom type="box" size=".01 .01 .01"/><site name="left_pad" pos="0 -.01 0"/>
        <body name="tip" pos="0 0 .03"><geom type="box" size=".01 .01 .01"/></body></body>
      <body name="right" pos="0 -.03 0"><geom type="box" size=".01 .01 .01"/><site name="right_pad" pos="0 .01 0"/></body>
    </body>
    <body name="box"><joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/><joint name="z" type="slide" axis="0 0 1"/>
      <geom type="box" size=".005 .0205 .005"/>
      <body name="knob" pos=".1 0 0"><geom type="box" size=".005 .0205 .005"/></body></body>
    <geom name="wall" type="box" size=".01 1 1" pos=".5 0 0"/>
  </worldbody>
</mujoco>)";

struct Fingers : ::testing::Test {
  Fingers() {
    gripper.pad_sites[0] = site("left_pad");
    gripper.pad_sites[1] = site("right_pad");
  }
  int site(const char* name) const { return mj_name2id(w.model, mjOBJ_SITE, name); }
  int body(const char* name) const { return mj_name2id(w.model, mjOBJ_BODY, name); }
  // Result of fingers_touch() with the box at (x, y, z).
  bool touch(double x, double y, double z, const char* what = "box") {
    w.data->qpos[0] = x, w.data->qpos[1] = y, w.data->qpos[2] = z;
    mj_forward(w.model, w.data);
    return fingers_touch(w.world(), gripper, body(what));
  }
  observe::TestWorld w{kScene};
  MoveGroup gripper;
};

TEST_F(Fingers, BothFingersMustTouch) {
  EXPECT_TRUE(touch(0, 0, 0));
  EXPECT_FALSE(touch(0, 0.004, 0)) << "only the left finger touches";
  EXPECT_FALSE(touch(0, -0.004, 0)) << "only the right finger touches";
  EXPECT_FALSE(touch(0.2, 0, 0)) << "no finger touches";
}

TEST_F(Fingers, ChildBodiesCount) {
  EXPECT_TRUE(touch(-0.1, 0, 0)) << "the knob is a child of the box";
  EXPECT_FALSE(touch(0, 0, 0, "knob")) << "the box is not below its knob";
  EXPECT_TRUE(touch(-0.1, 0, 0, "knob"));
  EXPECT_FALSE(touch(0, 0.0042, 0.03)) << "only the tip of the left finger touches";
}

TEST_F(Fingers, OtherContactsDoNotCount) {
  EXPECT_FALSE(touch(0.49, 0, 0)) << "the box touches the wall only";
  EXPECT_TRUE(touch(0, 0, 0));
  EXPECT_FALSE(fingers_touch(w.world(), gripper, -1));
  std::swap(gripper.pad_sites[0], gripper.pad_sites[1]);
  EXPECT_TRUE(touch(0, 0, 0)) << "the order of the pads does not matter";
  gripper.pad_sites[1] = -1;
  EXPECT_FALSE(touch(0, 0, 0)) << "a gripper without pads";
}

}  // namespace
}  // namespace mjsense::tasks::robots
