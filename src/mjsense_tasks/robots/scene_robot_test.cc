// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/scene_robot.h"

#include <gmock/gmock.h>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Two hinges with a motor each, two slides driven by one tendon, and one joint without actuator.
constexpr const char* kArm = R"(
<mujoco>
  <worldbody>
    <body name="link">
      <joint name="a" axis="0 0 1"/><joint name="b" axis="0 1 0"/><geom size=".1"/>
      <body><joint name="left" type="slide"/><geom size=".1"/></body>
      <body><joint name="right" type="slide"/><geom size=".1"/></body>
      <body><joint name="loose"/><geom size=".1"/></body>
    </body>
  </worldbody>
  <tendon><fixed name="both"><joint joint="left" coef="1"/><joint joint="right" coef="1"/></fixed></tendon>
  <actuator>
    <motor name="motor_a" joint="a" ctrlrange="-2 2" ctrllimited="true"/>
    <motor name="motor_b" joint="b"/>
    <position name="fingers" tendon="both"/>
  </actuator>
</mujoco>)";

struct SceneRobot : ::testing::Test {
  static scene::SceneCfg scene_cfg() {
    scene::EntityCfg arm;
    arm.model.xml = kArm;
    scene::SceneCfg cfg;
    cfg.entities = {{"arm", arm}};
    return cfg;
  }
  scene::Scene scene{scene_cfg()};
  const mjModel* model = scene.model();

  std::string error(const std::string& entity, const ActuatorGroups& groups) const {
    try {
      scene_robot(model, entity, groups, "task 'x'");
      return "";
    } catch (const Error& e) {
      return e.what();
    }
  }
};

TEST_F(SceneRobot, HasAllActuatorsOfTheEntity) {
  const RobotCfg cfg = scene_robot(model, "arm", {}, "");
  EXPECT_EQ(cfg.base_body, "mocap_base");
  ASSERT_EQ(cfg.groups.size(), 2u);
  EXPECT_EQ(cfg.groups[0].name, "base");
  EXPECT_EQ(cfg.groups[1].name, "joints");
  EXPECT_THAT(cfg.groups[1].actuators, ElementsAre("motor_a", "motor_b", "fingers"));
  EXPECT_THAT(cfg.groups[1].joints, ElementsAre("a", "b", "left", "right", "loose"));

  const RobotCfg whole = scene_robot(model, "", {}, "");
  EXPECT_EQ(whole.base_body, "world");
  EXPECT_THAT(whole.groups[1].actuators, ElementsAre("arm/motor_a", "arm/motor_b", "arm/fingers"));
}

TEST_F(SceneRobot, GroupsHaveTheJointsOfTheirActuators) {
  const RobotCfg cfg =
      scene_robot(model, "arm", {{"gripper", {"fingers"}}, {"turns", {"motor_.*"}}}, "");
  EXPECT_THAT(cfg.groups[1].joints, ElementsAre("left", "right"));
  EXPECT_THAT(cfg.groups[2].joints, ElementsAre("a", "b"));
}

TEST_F(SceneRobot, WithoutACommandControlsStay) {
  Robot robot(scene_robot(model, "arm", {}, ""), model, 1, "arm/");
  const DataPtr owned = make_data(model);
  mjData* data = owned.get();
  const World world{.id = 0, .model = model, .data = data};
  data->ctrl[0] = 1.5;
  data->ctrl[1] = -7;
  Rng rng(0, 0, 0, 0);
  robot.write_start(state_row(data), Pose{{1, 2, 3}, {}}, rng);
  EXPECT_EQ(data->mocap_pos[0], 1);
  EXPECT_EQ(data->ctrl[0], 1.5);
  mj_forward(model, data);
  robot.reset(world);
  EXPECT_THAT(robot.targets(0)[1].view(), ElementsAre(1.5, -7, 0));
  Action action;
  const double command[] = {5, 1, 2};  // the first exceeds its control range
  action.commands[1].set(command);
  robot.command(world, action);
  robot.write_ctrl(world, state_row(data), nullptr);
  EXPECT_THAT(std::vector<double>(data->ctrl, data->ctrl + 3), ElementsAre(2, 1, 2));
}

TEST_F(SceneRobot, WrongNamesAreErrors) {
  EXPECT_EQ(error("amr", {}), "task 'x': no robot entity named 'amr'; did you mean 'arm'?");
  EXPECT_THAT(error("arm", {{"g", {"motr_a"}}}), HasSubstr("task 'x', move group 'g'"));
  EXPECT_THAT(error("arm", {{"g", {"motor_a"}}, {"h", {"motor_.*"}}}),
              HasSubstr("actuator 'motor_a' already belongs to move group 'g'"));
}

}  // namespace
}  // namespace mjsense::tasks::robots
