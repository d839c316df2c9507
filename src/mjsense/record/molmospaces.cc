// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/molmospaces.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/record/json_rows.h"

namespace mjsense::record {
namespace {

constexpr int kTextBytes = 2000;

struct Text {
  std::string_view sensor;  // if it ends in '_': every sensor whose name begins with it
  const char* unit;  // null: the units of its streams, "arm: rad; gripper: 0 open .. 255 closed"
  const char* description;
};

constexpr Text kTexts[] = {
    {"qpos", "rad or m", "Joint positions by move group."},
    {"qvel", "rad/s or m/s", "Joint velocities by move group."},
    {"actions/commanded_action", nullptr, "The policy's action, unchanged."},
    {"actions/joint_pos", nullptr, "Targets of the controllers, without noise."},
    {"actions/joint_pos_rel", nullptr,
     "Targets of the controllers minus the previously observed joint positions."},
    {"actions/ee_twist", "m, rad",
     "Twist from each leaf frame's previously observed pose to its target pose, in the axes of "
     "that frame, per control step."},
    {"actions/ee_pose", "m, wxyz",
     "Target pose of each group's leaf frame in the robot's base frame."},
    {"grasp_state_", "", "Whether each gripper touches and holds the object."},
};

std::string units_of(const Sensor& sensor) {
  std::string units;
  for (const Field& field : sensor.fields()) {
    if (field.spec.unit.empty()) continue;
    units += fmt::format("{}{}: {}", units.empty() ? "" : "; ", field.name, field.spec.unit);
  }
  return units;
}

}  // namespace

std::string path_of(std::string_view stream) {
  constexpr std::string_view kParam = "sensor_param_";
  if (stream == "qpos" || stream == "qvel") return fmt::format("obs/agent/{}", stream);
  if (stream.starts_with("actions/") || stream.starts_with("env_states/") ||
      stream.starts_with("replay/"))
    return std::string(stream);
  if (stream.starts_with(kParam))
    return fmt::format("obs/sensor_param/{}", stream.substr(kParam.size()));
  return fmt::format("obs/extra/{}", stream);
}

std::string numbers_path(std::string_view text, std::string_view field) {
  return fmt::format("numbers/{}/{}", text, field);
}

std::span<const char* const> standard_groups() {
  static constexpr const char* kGroups[] = {
      "actions",   "env_states/actors", "env_states/articulations", "obs/agent",
      "obs/extra", "obs/sensor_data",   "obs/sensor_param"};
  return kGroups;
}

std::optional<SensorSpec> text_of(const Sensor& sensor) {
  const auto text = std::ranges::find_if(kTexts, [&](const Text& t) {
    return t.sensor.ends_with('_') ? sensor.name().starts_with(t.sensor)
                                   : sensor.name() == t.sensor;
  });
  if (text == std::end(kTexts) || !JsonRows::can_convert(sensor)) return std::nullopt;
  SensorSpec spec;
  spec.name = sensor.name();
  spec.dtype = DType::kUint8;
  spec.shape = {kTextBytes};
  spec.unit = text->unit ? text->unit : units_of(sensor);
  spec.low = 0;
  spec.high = 255;
  spec.is_dict = true;
  spec.str_max_len = kTextBytes;
  spec.description = text->description;
  return spec;
}

}  // namespace mjsense::record
