// SPDX-License-Identifier: Apache-2.0
#pragma once
// Configuration of a robot: the MJCF files that make it up, move groups with their controllers,
// start configuration, cameras. A robot.toml (robots/load_robot.h) has the fields below as keys.

#include <mujoco/mujoco.h>

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/sensor.h"
#include "mjsense/scene/entity.h"
#include "mjsense_tasks/robots/controllers/controller_cfg.h"

namespace mjsense::tasks::robots {

// kActuators: a group defined by its actuators; without a command their controls do not change.
enum class GroupKind { kBase, kTorso, kArm, kGripper, kHead, kActuators };
constexpr std::array<std::string_view, 6> enum_names(GroupKind) {
  return {"base", "torso", "arm", "gripper", "head", "actuators"};
}

// Names are local to the robot's model, without the "robot_0/" prefix.
struct MoveGroupCfg {
  std::string name;  // "arm"
  NamedEnum<GroupKind> kind = GroupKind::kArm;
  std::vector<std::string> joints, actuators;
  ControllerCfg controller;
  std::string leaf_site;
  std::string root_body;
  std::vector<double> init;
  std::vector<double> low_init;
  std::vector<double> spread;
  // Grippers only.
  double open_command = 0, closed_command = 0;
  double max_opening = 0;
  std::vector<std::string> pad_sites;
  double pad_half_width = 0, pad_half_length = 0;
};
template <class V>
void visit_fields(V& v, MoveGroupCfg& c) {
  v.object("MoveGroupCfg", "Joints of a robot that are commanded together.");
  v("name", c.name, "Name of the group in actions and observations.").required();
  v("kind", c.kind, "Type of the group; tasks use the first arm and the first gripper.").required();
  v("joints", c.joints, "Its joints, in the order of its values.");
  v("actuators", c.actuators,
    "Its actuators, in the order of its targets; empty: the group is not actuated.");
  v("controller", c.controller, "The meaning of a command.");
  v("leaf_site", c.leaf_site, "Site of its tool frame; empty: the robot's base frame.");
  v("root_body", c.root_body,
    "Body whose subtree forms the group; it contains the geoms of a gripper.");
  v("init", c.init, "Start positions (qpos) of its joints, rad or m.");
  v("stooped", c.low_init,
    "Start positions used if the target is too low for ``init``; empty: always ``init``.");
  v("spread", c.spread, "Half widths of the uniform noise of the start positions; empty: no noise.")
      .at_least(0);
  v("open_command", c.open_command, "Command of the actuators that opens a gripper.");
  v("closed_command", c.closed_command, "Command of the actuators that closes a gripper.");
  v("max_opening", c.max_opening, "Maximum distance between the pads of a gripper.")
      .unit("m")
      .at_least(0);
  v("pad_sites", c.pad_sites, "Two sites on the contact faces of a gripper's pads.");
  v("pad_half_width", c.pad_half_width, "Half size of a pad across the approach direction.")
      .unit("m")
      .at_least(0);
  v("pad_half_length", c.pad_half_length, "Half size of a pad along the approach direction.")
      .unit("m")
      .at_least(0);
}
void validate(const MoveGroupCfg& cfg, std::string_view context);

// A camera of the robot's model that an episode records.
struct CameraMount {
  std::string name;         // of the sensor: "wrist_camera"
  std::string mjcf_camera;  // local name
  bool record_depth = false;
  bool image_points = true;
  double min_visible = 0;  // see CameraMountCfg
};
template <class V>
void visit_fields(V& v, CameraMount& c) {
  v.object("CameraMount", "A camera of the robot that an episode records.");
  v("name", c.name, "Name of its stream.").required();
  v("camera", c.mjcf_camera, "Name of the camera in the model.").required();
  v("depth", c.record_depth, "Record its depth too.");
  v("image_points", c.image_points, "Use it for ``object_image_points``.");
  v("min_visible", c.min_visible,
    "Share of the pixels that each object of the task must cover at the start. If the pose in the "
    "model does not show that much, the camera is moved to one that does.")
      .within(0, 1);
}

// Action noise: a random displacement of the tool (truncated normal) that the arm's controller
// receives but recordings do not contain.
struct ActionNoiseCfg {
  double scale = 0.1;
  double rotation_ratio = 0.1;
  double max_position = 0.02;
  double max_rotation = 0.1;
  double max_joint = 0.05;
};
template <class V>
void visit_fields(V& v, ActionNoiseCfg& c) {
  v.object("ActionNoiseCfg", "Random displacement of the tool, added to the commands of an arm.");
  v("scale", c.scale, "Standard deviation per metre of commanded tool motion.").at_least(0);
  v("rotation_ratio", c.rotation_ratio, "Rotation (rad) per displacement (m).").at_least(0);
  v("max_position", c.max_position, "Limit of the displacement.").unit("m").positive();
  v("max_rotation", c.max_rotation, "Limit of the rotation.").unit("rad").positive();
  v("max_joint", c.max_joint,
    "Limit of the displacement of each joint (rad or m). Near singular postures it reduces the "
    "displacement of the tool.")
      .positive();
}

// A model attached to the robot's model, e.g. a gripper on the flange of an arm.
struct PartCfg {
  std::string model;
  std::string to;
  std::string prefix;
  std::array<double, 3> pos{0, 0, 0};
  std::array<double, 4> quat{1, 0, 0, 0};
};
template <class V>
void visit_fields(V& v, PartCfg& c) {
  v.object("PartCfg", "A model that is attached to the robot's model.");
  v("model", c.model, "Its MJCF, relative to this file's folder, or ``embedded:<file>``.")
      .required();
  v("to", c.to, "Site or body to which it is attached.").required();
  v("prefix", c.prefix, "Prefix of its names.");
  v("pos", c.pos, "Position of its root in the frame to which it is attached.").unit("m");
  v("quat", c.quat, "Orientation (wxyz) of its root in the frame to which it is attached.");
}

// Meshes that replace primitive shapes if a folder contains them.
struct MeshesCfg {
  std::string env;
  std::string folder;
  std::string replace;
  std::string material;
  std::vector<std::pair<std::string, std::string>> files;
};
template <class V>
void visit_fields(V& v, MeshesCfg& c) {
  v.object("MeshesCfg", "Meshes that replace primitive shapes if their folder exists.");
  v("env", c.env,
    "Environment variable that names the folder; it takes precedence over ``folder``.");
  v("folder", c.folder,
    "The folder, relative to this file; a folder that does not exist is ignored.");
  v("replace", c.replace, "Regular expression for the names of the geoms that are replaced.");
  v("material", c.material, "Material of the meshes.");
  v("files", c.files, "Mesh file of each body.");
}

// A sensor implemented by a Python class.
struct PythonSensorRef {
  std::string name;
  std::string class_name;  // "package.module:Class"
  std::string args;        // keyword arguments of the class, a JSON object
};

struct RobotCfg {
  std::string name;
  std::string description;
  scene::ModelSource model;
  // Called on the scene's spec before compilation with the prefix of the robot's names; may be
  // empty.
  std::function<void(mjSpec* spec, const std::string& prefix)> edit_spec;
  std::string base_body;             // the robot's base frame
  std::vector<MoveGroupCfg> groups;  // actions and observations have the same order
  std::vector<CameraMount> cameras;
  int image_width = 640, image_height = 368;  // one resolution for all cameras
  ActionNoiseCfg noise;
  int policy_dt_ms = 66, ctrl_dt_ms = 2, sim_dt_ms = 2;
  double opened = 0.15;  // task `open`: fraction of the range that counts as open
  // name of the additional row of env_states in MolmoSpaces' form; "": no row
  std::string env_state_name;
  int env_state_size = 0;  // number of its values; 0: as many as the groups need

  // Sensors that episodes with this robot observe and record. Elements are named with their prefix.
  std::vector<std::shared_ptr<const SensorCfg>> sensors;
  std::vector<PythonSensorRef> python_sensors;

  // The model as the file describes it; parse_robot() makes `model` and `edit_spec` from these.
  std::string mjcf;
  std::vector<PartCfg> parts;
  std::optional<MeshesCfg> meshes;
  std::string file;  // path of the robot.toml
};
template <class V>
void visit_fields(V& v, RobotCfg& c) {
  v.object("RobotCfg", "A robot.");
  v("name", c.name, "Name in messages and recordings; by default the folder's name.");
  v("description", c.description, "Description in one sentence.");
  v("model", c.mjcf, "Its MJCF, relative to this file's folder, or ``embedded:<file>``.")
      .required();
  v("parts", c.parts, "Models that are attached to it, in this order.");
  v("meshes", c.meshes, "Meshes that replace primitive shapes.");
  v("base", c.base_body, "Body that is the robot's base frame.").required();
  v("groups", c.groups, "Its move groups; actions and observations have the same order.");
  v("cameras", c.cameras, "Cameras that an episode records.");
  v("width", c.image_width, "Width of the images.").unit("pixels").at_least(1);
  v("height", c.image_height, "Height of the images.").unit("pixels").at_least(1);
  v("noise", c.noise, "Noise on the commands of arms.");
  v("policy_dt_ms", c.policy_dt_ms, "Duration of one action of a policy.").unit("ms").at_least(1);
  v("ctrl_dt_ms", c.ctrl_dt_ms, "Period of the controllers; it divides ``policy_dt_ms``.")
      .unit("ms")
      .at_least(1);
  v("sim_dt_ms", c.sim_dt_ms, "Duration of one physics step; it divides ``ctrl_dt_ms``.")
      .unit("ms")
      .at_least(1);
  v("opened", c.opened,
    "Fraction of its range beyond which a door or drawer counts as open (task ``open``).")
      .positive()
      .at_most(1);
  v("env_state_name", c.env_state_name,
    "Name of an additional row of ``env_states`` in MolmoSpaces' form; empty: no such row.");
  v("env_state_size", c.env_state_size,
    "Number of values in that row; 0: as many as the groups need.")
      .at_least(0);
}
// Checks that the periods divide each other and that names are unique.
void validate(const RobotCfg& cfg, std::string_view context);

}  // namespace mjsense::tasks::robots
