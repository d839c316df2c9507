// SPDX-License-Identifier: Apache-2.0
// Tests of robot.toml files: what they define, and that errors name file, line and key.
#include "mjsense_tasks/robots/load_robot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr const char* kArm = R"(<mujoco>
  <compiler angle="radian"/>
  <worldbody><body name="base" mocap="true"><body name="link" pos="0 0 0.2">
    <joint name="lift" axis="0 1 0" range="-2 2"/><geom size=".05" mass="1"/>
    <site name="flange" pos="0 0 0.3"/>
  </body></body></worldbody>
  <actuator><position name="lift" joint="lift" kp="500" dampratio="1" ctrlrange="-2 2"/></actuator>
  <keyframe><key name="home" qpos="1"/></keyframe>
</mujoco>)";
constexpr const char* kTool = R"(<mujoco>
  <worldbody><body name="tool"><geom size=".02" mass=".1"/><site name="tip" pos="0 0 .1"/></body></worldbody>
</mujoco>)";
constexpr const char* kToml = R"(model = "arm.xml"
base = "base"
width = 320
ctrl_dt_ms = 6
[[parts]]
model = "tool.xml"
to = "flange"
prefix = "tool/"
pos = [0, 0, 0.05]
[[groups]]
name = "arm"
kind = "arm"
joints = ["lift"]
actuators = ["lift"]
controller = { kind = "joint_position_relative", threshold = 0.001 }
leaf_site = "tool/tip"
init = [0.5]
spread = [0.1]
)";

struct RobotFile : ::testing::Test {
  RobotFile() {
    std::filesystem::create_directory(folder.path / "lifter");
    write("arm.xml", kArm);
    write("tool.xml", kTool);
  }
  void write(const char* name, const std::string& text) {
    std::ofstream(folder.path / "lifter" / name) << text;
  }
  std::string path() const { return (folder.path / "lifter" / "robot.toml").string(); }
  RobotCfg load(const std::string& toml) {
    write("robot.toml", toml);
    return robot_cfg(path());
  }
  std::string fault(const std::string& toml) {
    try {
      load(toml);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }
  // kToml with `old` replaced by `now`.
  static std::string with(const std::string& old, const std::string& now) {
    std::string text = kToml;
    return text.replace(text.find(old), old.size(), now);
  }
  mjsense::testing::TempDir folder;
};

TEST_F(RobotFile, DefinesARobot) {
  const RobotCfg cfg = load(kToml);
  EXPECT_EQ(cfg.name, "lifter");
  EXPECT_EQ(cfg.file, path());
  EXPECT_EQ(cfg.image_width, 320);
  EXPECT_EQ(cfg.image_height, 368);
  EXPECT_EQ(cfg.ctrl_dt_ms, 6);
  ASSERT_EQ(cfg.groups.size(), 1u);
  EXPECT_THAT(cfg.groups[0].joints, ElementsAre("lift"));
  ASSERT_TRUE(std::holds_alternative<JointPositionRelativeCfg>(cfg.groups[0].controller));
  EXPECT_EQ(std::get<JointPositionRelativeCfg>(cfg.groups[0].controller).threshold, 0.001);
}

TEST_F(RobotFile, PartsAreAttachedAtTheirPoses) {
  const RobotCfg cfg = load(kToml);
  scene::SceneCfg scene_cfg;
  scene::EntityCfg entity;
  entity.model = cfg.model;
  scene_cfg.entities = {{"robot_0", entity}};
  const scene::Scene scene(scene_cfg);
  const mjModel* m = scene.model();
  const int tool = mj_name2id(m, mjOBJ_BODY, "robot_0/tool/tool");
  ASSERT_GE(tool, 0);
  EXPECT_EQ(m->body_parentid[tool], mj_name2id(m, mjOBJ_BODY, "robot_0/link"));
  EXPECT_NEAR(m->body_pos[3 * tool + 2], 0.35, 1e-12);
  EXPECT_TRUE(scene.warnings().empty()) << scene.warnings()[0];
  const Robot robot(cfg, m, 1);
  RobotValues q;
  const double lift = 0;
  q[0].set({&lift, 1});
  EXPECT_NEAR(robot.fk(0, q).p.z, 0.2 + 0.3 + 0.05 + 0.1, 1e-12);
}

TEST_F(RobotFile, ErrorsNameFileLineAndKey) {
  const std::string file = path();
  EXPECT_EQ(fault(with("joints", "jonts")),
            file + ":13: no key of 'groups[0]' named 'jonts'; did you mean 'joints'?");
  EXPECT_THAT(fault(with("kind = \"arm\"", "kind = \"arn\"")),
              HasSubstr(file + ":12: groups[0].kind is 'arn': must be one of base, torso, arm"));
  EXPECT_THAT(fault(with("[0.5]", "0.5")),
              HasSubstr(file + ":17: the value of 'groups[0].init' has the wrong type"));
  EXPECT_THAT(fault(with("name = \"arm\"\n", "")), HasSubstr("'groups[0]': 'name' is missing"));
  EXPECT_THAT(fault(with("[0.1]", "[0.1, 0.2]")),
              HasSubstr("'arm': spread has 2 values, init has 1"));
  EXPECT_THAT(fault(with("[0.1]", "[-0.1]")), HasSubstr(":18: groups[0]: spread[0] is -0.1"));
  EXPECT_THAT(fault(with("ctrl_dt_ms = 6", "ctrl_dt_ms = 4")), HasSubstr("policy_dt_ms = 66"));
  EXPECT_THAT(fault(with("joint_position_relative", "joint_posision")),
              HasSubstr(":15: groups[0].controller.kind is 'joint_posision': must be one of"));
  EXPECT_THAT(fault(with("threshold", "treshold")), HasSubstr("did you mean 'threshold'?"));
  EXPECT_THAT(fault(with("to = \"flange\"", "to = \"flang\"")),
              HasSubstr("no site or body named 'flang'; did you mean 'flange'?"));
  EXPECT_THAT(fault(with("tool.xml", "tol.xml")), HasSubstr("tol.xml"));
  EXPECT_THAT(fault("model = \n"), HasSubstr(file + ":1:"));
  EXPECT_THAT(fault("base = \"base\"\n"), HasSubstr("'model' is missing"));
}

// Also required references whose key is missing.
TEST_F(RobotFile, EveryReferenceIsResolvedWhenItIsLoaded) {
  const std::string context = path() + ": move group 'arm': ";
  EXPECT_EQ(fault(with("base = \"base\"", "base = \"bas\"")),
            path() + ": base: no body named 'bas'; did you mean 'base'?");
  EXPECT_EQ(fault(with("joints = [\"lift\"]", "joints = [\"left\"]")),
            context + "joints: no joint named 'left'; did you mean 'lift'?");
  EXPECT_EQ(fault(with("actuators = [\"lift\"]", "actuators = [\"lit\"]")),
            context + "actuators: no actuator named 'lit'; did you mean 'lift'?");
  EXPECT_EQ(fault(with("tool/tip", "tool/tp")),
            context + "leaf_site: no site named 'tool/tp'; did you mean 'tool/tip'?");
  EXPECT_EQ(fault(std::string(kToml) + "root_body = \"link2\"\n"),
            context + "root_body: no body named 'link2'; did you mean 'link'?");
  EXPECT_THAT(fault(with("{ kind = \"joint_position_relative\", threshold = 0.001 }",
                         "{ kind = \"free_base\", target = \"goal\" }")),
              HasSubstr("controller.target: no body named 'goal'"));
  EXPECT_THAT(fault(std::string(kToml) + "[[cameras]]\nname = \"wrist\"\ncamera = \"eye\"\n"),
              HasSubstr("camera 'wrist': no camera named 'eye'"));
  const std::string gripper = std::string(kToml) + R"([[groups]]
name = "gripper"
kind = "gripper"
pad_sites = ["flange", "tool/tip"]
)";
  EXPECT_THAT(fault(gripper + "leaf_site = \"flange\"\n"),
              HasSubstr("the gripper 'gripper' needs root_body"));
  EXPECT_THAT(fault(gripper + "root_body = \"link\"\n"),
              HasSubstr("the gripper 'gripper' needs leaf_site"));
  const std::string sites = gripper + "leaf_site = \"flange\"\nroot_body = \"link\"\n";
  EXPECT_EQ(fault(sites),
            path() +
                ":19: groups[1]: the gripper 'gripper' needs max_opening, the distance "
                "between its open pads, in m; it is 0: write for example max_opening = "
                "0.08");
  EXPECT_THAT(
      fault(sites + "max_opening = 0.08\npad_half_length = 0.02\n"),
      HasSubstr("'gripper' needs pad_half_width, half the width of a pad across the approach, "
                "the tool's x axis, in m; it is 0: write for example pad_half_width = 0.01"));
  EXPECT_THAT(fault(sites + "max_opening = 0.08\npad_half_width = 0.01\n"),
              HasSubstr("'gripper' needs pad_half_length"));
  const std::string sizes = "max_opening = 0.08\npad_half_width = 0.01\npad_half_length = 0.02\n";
  EXPECT_EQ(fault(sites + sizes), "no error");
  EXPECT_THAT(
      fault(sites + sizes + "actuators = [\"lift\"]\nopen_command = 1\nclosed_command = 1\n"),
      HasSubstr("'gripper' has the same open_command and closed_command, 1"));
  EXPECT_THAT(fault(with("arm.xml", "amr.xml")), HasSubstr("amr.xml"));
}

TEST_F(RobotFile, ANameThatAPartRepeatsIsNamedWithItsPart) {
  EXPECT_EQ(
      fault(with("[[groups]]",
                 "[[parts]]\nmodel = \"tool.xml\"\nto = \"flange\"\nprefix = "
                 "\"tool/\"\n[[groups]]")),
      path() + ": part '" + (folder.path / "lifter" / "tool.xml").string() +
          "': its body 'tool/tool' has the name of a body of the models before it; its prefix "
          "is 'tool/': write another one, for example prefix = \"tool2/\"");
}

TEST_F(RobotFile, StartPositionsAreWithinTheRangesOfTheirJoints) {
  const RobotCfg cfg = load(with("init = [0.5]", "init = [2.5]"));
  const mjsense::scene::SpecPtr spec = scene::parse_model({.xml = robot_xml(cfg)}, "test");
  const ModelPtr model(mj_compile(spec.get(), nullptr));
  EXPECT_THAT([&] { Robot(cfg, model.get(), 1, ""); },
              ::testing::ThrowsMessage<ValueError>(HasSubstr(
                  "start position (init) of joint 'lift' is 2.5, outside of its range [-2, 2]")));
}

// A hand whose pads are apart along y and whose tool frame is rotated by the site.
TEST_F(RobotFile, TheToolFrameOfAGripperIsChecked) {
  const auto fault_with = [&](const std::string& site) {
    write("tool.xml", R"(<mujoco><worldbody><body name="tool"><geom size=".02" mass=".1"/>
      <site name="left" pos="0 .02 .1"/><site name="right" pos="0 -.02 .1"/>
      <site name="tip" pos="0 0 .1" )" +
                          site + "/></body></worldbody></mujoco>");
    const RobotCfg cfg = load(std::string(kToml) + R"([[groups]]
name = "gripper"
kind = "gripper"
leaf_site = "tool/tip"
root_body = "tool/tool"
pad_sites = ["tool/left", "tool/right"]
max_opening = 0.08
pad_half_width = 0.01
pad_half_length = 0.02
)");
    const mjsense::scene::SpecPtr spec = scene::parse_model({.xml = robot_xml(cfg)}, "test");
    const ModelPtr model(mj_compile(spec.get(), nullptr));
    try {
      const Robot robot(cfg, model.get(), 1, "");
    } catch (const ValueError& e) {
      return std::string(e.what());
    }
    return std::string("no error");
  };
  EXPECT_EQ(fault_with(""), "no error");
  EXPECT_EQ(fault_with(R"(euler="0 0 90")"), "no error") << "the pads may be apart along x";
  const std::string begin =
      path() + ": move group 'gripper': leaf_site 'tool/tip': its z axis must";
  const std::string back = fault_with(R"(euler="180 0 0")");
  EXPECT_THAT(back, StartsWith(begin));
  EXPECT_THAT(back, HasSubstr(", -1.00) of the hand and apart along (0.00, "));
  const std::string aside = fault_with(R"(euler="90 0 0")");
  EXPECT_THAT(aside, StartsWith(begin));
  // What the message proposes is accepted.
  for (const std::string& text : {back, aside})
    EXPECT_EQ(fault_with(text.substr(text.find("quat="))), "no error") << text;
}

TEST(RobotNames, AreFoundOrTheNearestIsSuggested) {
  for (const std::string& name : robot_names()) EXPECT_EQ(robot_cfg(name).name, name);
  try {
    robot_cfg("frnka");
    FAIL();
  } catch (const KeyError& e) {
    EXPECT_THAT(e.what(), HasSubstr("no robot named 'frnka'; did you mean 'franka'?"));
  }
  EXPECT_THROW(robot_cfg("nowhere/robot.toml"), ValueError);
}

}  // namespace
}  // namespace mjsense::tasks::robots
