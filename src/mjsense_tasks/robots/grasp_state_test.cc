// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/grasp_state.h"

#include <gmock/gmock.h>

#include "mjsense/observe/testing/world.h"

namespace mjsense::tasks::robots {
namespace {

// A gripper that is one sphere at (1, 0, .58), and a cube on the floor.
constexpr char kGripper[] = R"(
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="robot/base" mocap="true" pos="1 0 0">
      <body name="robot/link" pos="0 0 .58"><geom name="robot/pad" size=".05"/></body>
    </body>
    <body name="thing/cube" pos="3 0 .05"><freejoint/><geom name="cube" type="box" size=".05 .05 .05" mass=".1"/></body>
  </worldbody>
</mujoco>)";

TEST(GraspState, TouchingIsNotHolding) {
  observe::TestWorld w(kGripper);
  GraspStateSensor grasp("grasp_state_pickup_obj", "thing/cube", {{"gripper", "robot/base"}});
  const auto held = [&]() -> bool { return observe::values<bool>(grasp, "gripper/held")[0]; };
  const auto touching = [&]() -> bool {
    return observe::values<bool>(grasp, "gripper/touching")[0];
  };
  w.compute(grasp);  // the cube rests on the floor; the gripper is far away
  EXPECT_FALSE(held());
  EXPECT_FALSE(touching());

  const auto place = [&](double z) {
    w.data->qpos[0] = 1;
    w.data->qpos[2] = z;
    mj_forward(w.model, w.data);
    grasp.compute(w.world());
  };
  place(.58 + .09);
  EXPECT_TRUE(held());
  EXPECT_TRUE(touching());
  // Now the gripper touches the cube from above while the cube rests on the floor.
  w.data->mocap_pos[2] = -.58 + .05 + .05 + .04;
  place(.0499);
  EXPECT_FALSE(held());
  EXPECT_TRUE(touching());
  EXPECT_EQ(grasp.field("gripper/held").spec.name, "grasp_state_pickup_obj/gripper/held");
}

}  // namespace
}  // namespace mjsense::tasks::robots
