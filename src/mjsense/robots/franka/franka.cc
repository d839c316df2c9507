#include "mjsense/robots/franka/franka.h"

namespace mjsense {

RobotCfg franka_cfg() {
  RobotCfg cfg;
  cfg.name = "franka";
  cfg.model.path = "embedded:franka/fr3.xml";
  cfg.base_body = "base";

  MoveGroupCfg base;
  base.name = "base";
  base.kind = GroupKind::kBase;
  base.root_body = "base";

  MoveGroupCfg arm;
  arm.name = "arm";
  arm.kind = GroupKind::kArm;
  for (int i = 1; i <= 7; ++i) arm.joints.push_back("fr3_joint" + std::to_string(i));
  arm.actuators = arm.joints;
  arm.leaf_site = "gripper/grasp_site";
  arm.root_body = "fr3_link0";
  arm.init = {0, -0.7853, 0, -2.35619, 0, 1.57079, 0};
  arm.spread = {0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175};

  MoveGroupCfg gripper;
  gripper.name = "gripper";
  gripper.kind = GroupKind::kGripper;
  gripper.joints = {"gripper/left_driver_joint", "gripper/right_driver_joint"};
  gripper.actuators = {"gripper/fingers_actuator"};
  gripper.leaf_site = "gripper/grasp_site";
  gripper.root_body = "gripper/base";
  gripper.init = {0.00296, 0.00296};
  gripper.open_command = 0;
  gripper.closed_command = 255;
  gripper.max_opening = 0.087;
  gripper.pad_half_width = 0.011;
  gripper.pad_half_length = 0.019;
  gripper.pad_sites = {"gripper/left_pad", "gripper/right_pad"};

  cfg.groups = {base, arm, gripper};
  cfg.cameras = {{"wrist_camera", "gripper/wrist_camera"}, {"exo_camera_1", "exo_camera_1"}};
  return cfg;
}

}  // namespace mjsense
