// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/contact_depth.h"

#include <gtest/gtest.h>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/mj_spec.h"

namespace mjsense::tasks::rollout {
namespace {

// A ball of 5 cm on a plane, and one that is 6 mm in another plane's box from the start on.
struct Balls {
  Balls() {
    const scene::SpecPtr spec = scene::parse_model({.xml = R"(<mujoco><worldbody>
      <geom name="floor" type="plane" size="1 1 .1"/>
      <body name="ball"><joint name="up" type="slide" axis="0 0 1"/><geom size=".05" mass="1"/></body>
      <body name="sunk" pos=".5 0 .044"><joint type="slide" axis="0 0 1"/><geom size=".05" mass="1"/></body>
      </worldbody></mujoco>)"},
                                                   "test");
    model.reset(mj_compile(spec.get(), nullptr));
    data = make_data(model.get());
    world = {.id = 0, .model = model.get(), .data = data.get()};
  }
  void observe(ContactDepth& depth, double into) {
    data->qpos[0] = 0.05 - into;
    mj_forward(model.get(), data.get());
    depth.observe(world);
  }
  ModelPtr model;
  DataPtr data;
  World world;
};

TEST(ContactDepth, ACountsFromTheLimitOnAndNotWhatTheStartHas) {
  Balls balls;
  ContactDepth depth(0.004, 1);
  depth.begin(0);
  balls.observe(depth, -0.01);
  balls.observe(depth, 0.0039);
  EXPECT_FALSE(depth.is_exceeded(0));
  EXPECT_EQ(depth.description(0, balls.model.get()), "");
  balls.observe(depth, 0.0052);
  balls.observe(depth, 0.0045);
  ASSERT_TRUE(depth.is_exceeded(0));
  EXPECT_EQ(depth.description(0, balls.model.get()),
            "5.2 mm in step 2: 'floor' and 'ball'; max_penetration is 4 mm");
  depth.begin(0);
  EXPECT_FALSE(depth.is_exceeded(0));
  balls.observe(depth, 0.0052);  // part of the start
  balls.observe(depth, 0.0060);
  EXPECT_FALSE(depth.is_exceeded(0));
}

}  // namespace
}  // namespace mjsense::tasks::rollout
