// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a robot is, as data: its MJCF, move groups, start configuration, cameras. One function a
// robot fills one in.

#include <mujoco/mujoco.h>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/scene/entity.h"

namespace mjsense {

// kActuators: whatever they drive; without a command they stay as they are.
enum class GroupKind { kBase, kArm, kGripper, kActuators };

// Names are local to the robot's MJCF, without the "robot_0/" prefix.
struct MoveGroupCfg {
  std::string name;  // "arm"
  GroupKind kind = GroupKind::kArm;
  std::vector<std::string> joints, actuators;
  std::string leaf_site;       // the group's tool frame; "" for a base
  std::string root_body;       // its subtree is the group: the gripper's geoms of grasp_state_*
  std::vector<double> init;    // start joint positions, rad or m
  std::vector<double> spread;  // half widths of their uniform start noise; empty: none
  // Grippers only.
  double open_command = 0, closed_command = 0;     // of the actuator
  double max_opening = 0;                          // m, between the pads
  std::vector<std::string> pad_sites;              // two, on the pads' faces
  double pad_half_width = 0, pad_half_length = 0;  // m, across and along the approach
};

// A camera of the robot's MJCF that an episode records.
struct CameraMount {
  std::string name;         // of the sensor: "wrist_camera"
  std::string mjcf_camera;  // local name
  bool record_depth = false;
  bool image_points = true;  // object_image_points looks through it
};

// Displacement of the tool that the arm's controllers see and recordings do not; normal, truncated.
struct ActionNoiseCfg {
  double scale = 0.1;           // standard deviation per metre that the command would move the tool
  double rotation_ratio = 0.1;  // rotation deviation (rad) per position deviation (m)
  double max_position = 0.02;   // m, truncation
  double max_rotation = 0.1;    // rad
};

struct RobotCfg {
  std::string name;  // "franka"
  ModelSource model;
  // Called on the scene's spec before compilation with the prefix of the robot's names; may be
  // empty.
  std::function<void(mjSpec* spec, const std::string& prefix)> edit_spec;
  std::string base_body;             // mocap body on the floor: the robot base frame
  std::vector<MoveGroupCfg> groups;  // in this order everywhere
  std::vector<CameraMount> cameras;
  int image_width = 640, image_height = 368;  // one resolution for all cameras
  ActionNoiseCfg noise;
  int env_state_size = 0;  // env_states: numbers of the articulation row; 0: what the groups need
  std::string env_state_name;  // of that row; "": the robot's
};

}  // namespace mjsense
