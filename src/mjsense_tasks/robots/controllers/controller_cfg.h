// SPDX-License-Identifier: Apache-2.0
#pragma once
// Configurations of the controllers; each defines the meaning of a group's commands.

#include <array>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "mjsense/core/fields/field_traits.h"
#include "mjsense/core/fields/named_enum.h"

namespace mjsense::tasks::robots {

// Without a ramp a servo jumps at every command; if the policy period is long, held objects slip.
inline constexpr const char* kRampText =
    "The controls are interpolated linearly from one command to the next, one part per control "
    "step, instead of jumping.";

struct JointPositionCfg {
  bool ramp = false;
};
template <class V>
void visit_fields(V& v, JointPositionCfg& c) {
  v.object("JointPositionCfg", "A command is the target positions of the actuators.",
           "joint_position");
  v("ramp", c.ramp, kRampText);
}

struct JointPositionRelativeCfg {
  double threshold = 1e-6;
};
template <class V>
void visit_fields(V& v, JointPositionRelativeCfg& c) {
  v.object("JointPositionRelativeCfg", "A command is a displacement from the current positions.",
           "joint_position_relative");
  v("threshold", c.threshold, "A joint whose command is smaller than this keeps its target.")
      .at_least(0);
}

struct JointVelocityCfg {};
template <class V>
void visit_fields(V& v, JointVelocityCfg&) {
  v.object("JointVelocityCfg",
           "A command is a velocity, for velocity servos or for the targets of position servos.",
           "joint_velocity");
}

struct TorsoHeightCfg {
  std::array<double, 2> range{0, 0.738};
  std::vector<double> ratio;
};
template <class V>
void visit_fields(V& v, TorsoHeightCfg& c) {
  v.object("TorsoHeightCfg", "A single command moves the joints that lift the torso.",
           "torso_height");
  v("range", c.range, "Range of the command.").unit("rad");
  v("ratio", c.ratio, "Position of each joint per unit of the command.").required();
}

struct HolonomicBaseCfg {
  bool ramp = false;
  double noise = 0.1;
  double max_position_noise = 0.02;
  double max_rotation_noise = 0.05;
};
template <class V>
void visit_fields(V& v, HolonomicBaseCfg& c) {
  v.object(
      "HolonomicBaseCfg",
      "A command is a pose on the floor, x, y and yaw, for two slide joints and a hinge joint.",
      "holonomic_base");
  v("ramp", c.ramp, kRampText);
  v("noise", c.noise, "Standard deviation per unit of the motion.").at_least(0);
  v("max_position_noise", c.max_position_noise, "Limit of the position noise.")
      .unit("m")
      .positive();
  v("max_rotation_noise", c.max_rotation_noise, "Limit of the rotation noise.")
      .unit("rad")
      .positive();
}

struct DifferentialBaseCfg {
  double max_speed = 1.0;
  double max_turn = 2.0;
  double wheel_radius = 0.1;
  double track = 0.5;
};
template <class V>
void visit_fields(V& v, DifferentialBaseCfg& c) {
  v.object("DifferentialBaseCfg",
           "A command is a forward speed and a turning speed, for two wheels (left, right) or for "
           "two slide joints and a hinge joint.",
           "differential_base");
  v("max_speed", c.max_speed, "Limit of the forward speed.").unit("m/s").positive();
  v("max_turn", c.max_turn, "Limit of the turning speed.").unit("rad/s").positive();
  v("wheel_radius", c.wheel_radius, "Radius of the wheels.").unit("m").positive();
  v("track", c.track, "Distance between the wheels.").unit("m").positive();
}

struct MocapBaseCfg {
  double max_speed = 1.0;
  double max_turn = 2.0;
};
template <class V>
void visit_fields(V& v, MocapBaseCfg& c) {
  v.object("MocapBaseCfg", "A command is a pose in the world, for a base that is a mocap body.",
           "mocap_base");
  v("max_speed", c.max_speed, "Maximum speed of the base.").unit("m/s").positive();
  v("max_turn", c.max_turn, "Maximum turning speed of the base.").unit("rad/s").positive();
}

struct FreeBaseCfg {
  std::string target;
  double max_speed = 1.0;
  double max_turn = 2.0;
};
template <class V>
void visit_fields(V& v, FreeBaseCfg& c) {
  v.object("FreeBaseCfg",
           "A command is a pose in the world, for a floating base that is welded to a mocap body.",
           "free_base");
  v("target", c.target, "The mocap body.").required();
  v("max_speed", c.max_speed, "Maximum speed of the mocap body.").unit("m/s").positive();
  v("max_turn", c.max_turn, "Maximum turning speed of the mocap body.").unit("rad/s").positive();
}

struct EePoseCfg {
  double max_speed = 0.5;
  double max_turn = 2.0;
  double max_joint_speed = 2.0;
};
template <class V>
void visit_fields(V& v, EePoseCfg& c) {
  v.object(
      "EePoseCfg",
      "A command is a pose of the tool in the robot's base frame: x, y, z (m) and a quaternion "
      "wxyz. Inverse kinematics turns it into the targets of the arm's position servos.",
      "ee_pose");
  v("max_speed", c.max_speed, "Maximum speed of the tool.").unit("m/s").positive();
  v("max_turn", c.max_turn, "Maximum turning speed of the tool.").unit("rad/s").positive();
  v("max_joint_speed", c.max_joint_speed,
    "Maximum speed of each joint's target, rad/s or m/s. Near singular postures it slows the tool.")
      .positive();
}

enum class DeltaFrame { kBase, kTool };
constexpr std::array<std::string_view, 2> enum_names(DeltaFrame) { return {"base", "tool"}; }

enum class DeltaReference { kTarget, kMeasured };
constexpr std::array<std::string_view, 2> enum_names(DeltaReference) {
  return {"target", "measured"};
}

struct EeDeltaPoseCfg {
  NamedEnum<DeltaFrame> frame = DeltaFrame::kBase;
  NamedEnum<DeltaReference> reference = DeltaReference::kTarget;
  double max_translation = 0.05;
  double max_rotation = 0.25;
  double max_joint_speed = 2.0;
};
template <class V>
void visit_fields(V& v, EeDeltaPoseCfg& c) {
  v.object("EeDeltaPoseCfg",
           "A command is a displacement of the tool: x, y, z (m) and a rotation vector (rad). "
           "Inverse kinematics turns it into the targets of the arm's position servos.",
           "ee_delta_pose");
  v("frame", c.frame,
    "Axes of the command: those of the robot's base frame, or those of the tool. Rotation is about "
    "the tool's origin in both cases.");
  v("reference", c.reference,
    "Pose to which the displacement is added: the last target, or the measured pose, from which a "
    "loaded arm sinks.");
  v("max_translation", c.max_translation, "Limit of x, y and z of a command.").unit("m").positive();
  v("max_rotation", c.max_rotation, "Limit of each part of the rotation vector of a command.")
      .unit("rad")
      .positive();
  v("max_joint_speed", c.max_joint_speed,
    "Maximum speed of each joint's target, rad/s or m/s. Near singular postures it slows the tool.")
      .positive();
}

struct NoControllerCfg {};
template <class V>
void visit_fields(V& v, NoControllerCfg&) {
  v.object("NoControllerCfg", "The group takes no command and keeps its start position.", "none");
}

using ControllerCfg =
    std::variant<JointPositionCfg, JointPositionRelativeCfg, JointVelocityCfg, TorsoHeightCfg,
                 HolonomicBaseCfg, DifferentialBaseCfg, MocapBaseCfg, FreeBaseCfg, EePoseCfg,
                 EeDeltaPoseCfg, NoControllerCfg>;

}  // namespace mjsense::tasks::robots

namespace mjsense {
template <>
inline constexpr const char* kChoiceName<tasks::robots::ControllerCfg> = "ControllerCfg";
}  // namespace mjsense

namespace mjsense::tasks::robots {

// Reads the kind of a controller, "ee_delta_pose", or an inline table of TOML with its fields,
// "{ kind = 'ee_delta_pose', frame = 'tool' }". `context` begins the message of a ValueError.
ControllerCfg parse_controller(std::string_view text, const std::string& context);

}  // namespace mjsense::tasks::robots
