// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/base_reposition.h"

#include <gtest/gtest.h>

#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/policies/planner/testing/table_scene.h"

namespace mjsense::tasks::policies {
namespace {

// RB-Y1 in front of a table.
struct Shifted : ::testing::Test {
  TableStage stage{"rby1"};
  BaseReposition shift{stage.world.model, stage.robot()};
  // Forward distance (m) of the base in `there` from its present position.
  double ahead(const World& there) const {
    return (inverse(stage.robot().base_pose(stage.world)) * stage.robot().base_pose(there)).p.x;
  }
};

TEST_F(Shifted, DrivesToTheNearestPoseThatWorks) {
  Plan plan;
  std::optional<Pose> seen;
  ASSERT_TRUE(shift.plan(
      stage.world, 6, {},
      [&](const World& there) {
        seen = stage.robot().base_pose(there);
        return ahead(there) < -0.2;
      },
      plan));
  ASSERT_EQ(plan.segments.size(), 1u);
  EXPECT_EQ(plan.segments[0].phase, 6);
  const auto& path = plan.segments[0].paths.at(0);
  const Pose from = stage.robot().base_pose(stage.world);
  EXPECT_NEAR(norm(seen->p - from.p), 0.24, 1e-9) << "two grid steps straight back";
  EXPECT_NEAR(path.points[path.points.size() - 3], seen->p.x, 1e-9);
  EXPECT_NEAR(path.points[path.points.size() - 2], seen->p.y, 1e-9);
}

TEST_F(Shifted, RejectsPosesInsideTheTable) {
  Plan plan;
  EXPECT_FALSE(shift.plan(
      stage.world, 6, {}, [&](const World& there) { return ahead(there) > 0.3; }, plan));
  EXPECT_TRUE(plan.segments.empty());
}

TEST_F(Shifted, HeldObjectsMoveWithTheBase) {
  const mjModel* m = stage.world.model;
  const int block = scene::resolve(m, mjOBJ_BODY, "red_block/red_block", "test");
  const robots::Hand hand = robots::hands_of(stage.robot(), m).at(0);
  const Pose tool_object{{0, 0, 0.02}, {}};
  Plan plan;
  ASSERT_TRUE(shift.plan(
      stage.world, 6, BaseReposition::Held{hand, block, tool_object},
      [&](const World& there) {
        const Pose expected = stage.robot().leaf_pose(there, hand.tool) * tool_object;
        EXPECT_LT(norm(vec3(there.data->xpos + 3 * block) - expected.p), 1e-9);
        return ahead(there) < 0;
      },
      plan));
  EXPECT_EQ(plan.segments[0].holding, std::vector<int>{hand.gripper});
}

}  // namespace
}  // namespace mjsense::tasks::policies
