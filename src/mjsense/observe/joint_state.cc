#include "mjsense/observe/joint_state.h"

#include <algorithm>

namespace mjsense {

JointStateSensor::JointStateSensor(std::string name, What what, std::vector<JointGroup> groups,
                                   int str_max_len)
    : JsonSensor(std::move(name), str_max_len,
                 what == What::kPosition ? "Joint positions by move group."
                                         : "Joint velocities by move group.",
                 what == What::kPosition ? "rad or m" : "rad/s or m/s"),
      what_(what),
      groups_(std::move(groups)) {
  std::ranges::sort(groups_, {}, &JointGroup::name);
}

void JointStateSensor::write(const World& world, JsonWriter& json) {
  const bool position = what_ == What::kPosition;
  const mjtNum* source = position ? world.data->qpos : world.data->qvel;
  json.begin_object();
  for (const JointGroup& group : groups_) {
    json.key(group.name).begin_array();
    for (int address : position ? group.qpos : group.dof) {
      json.value(static_cast<double>(static_cast<float>(source[address])));
    }
    json.end_array();
  }
  json.end_object();
}

std::size_t JointStateSensor::max_bytes() const {
  std::size_t bytes = 2;
  for (const JointGroup& group : groups_) {
    bytes +=
        group_bytes(group.name, what_ == What::kPosition ? group.qpos.size() : group.dof.size());
  }
  return bytes;
}

std::size_t group_bytes(std::string_view name, std::size_t numbers) {
  return name.size() + 6 + numbers * JsonSensor::kNumberBytes;  // "name":[...],
}

}  // namespace mjsense
