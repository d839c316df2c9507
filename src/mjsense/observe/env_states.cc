// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/env_states.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"

namespace mjsense {

EnvStatesSensor::EnvStatesSensor(std::string name, std::string articulation,
                                 std::vector<JointGroup> groups, int length, std::string robot_body)
    : Sensor(std::move(name)),
      articulation_(std::move(articulation)),
      groups_(std::move(groups)),
      length_(length),
      robot_body_(std::move(robot_body)) {
  int needed = 0;
  for (const JointGroup& group : groups_)
    needed += static_cast<int>(group.qpos.size() + group.dof.size());
  if (length_ == 0) length_ = needed;
  if (length_ < needed) {
    throw ValueError(fmt::format("sensor '{}': articulation '{}' needs {} numbers, length is {}",
                                 this->name(), articulation_, needed, length_));
  }
}

void EnvStatesSensor::initialize(const SensorInit& init) {
  const mjModel* m = init.model;
  const int robot = robot_body_.empty()
                        ? -1
                        : object_id(m, mjOBJ_BODY, fmt::format("sensor '{}'", name()), robot_body_);
  clear_fields();
  actors_.clear();
  std::vector<std::string> full, last;
  for (int j = 0; j < m->njnt; ++j) {
    const int body = m->jnt_bodyid[j];
    if (m->jnt_type[j] != mjJNT_FREE) continue;
    if (robot >= 0 && is_below(m, body, robot)) continue;
    const char* name = mj_id2name(m, mjOBJ_BODY, body);
    full.push_back(name ? name : fmt::format("body_{}", body));
    last.push_back(full.back().substr(full.back().rfind('/') + 1));
    actors_.push_back({m->jnt_qposadr[j], m->jnt_dofadr[j]});
  }
  for (std::size_t i = 0; i < full.size(); ++i) {
    std::string actor = std::ranges::count(last, last[i]) == 1 ? last[i] : full[i];
    std::ranges::replace(actor, '/', '_');
    SensorSpec spec;
    spec.shape = {13};
    spec.unit = "m, wxyz, m/s, rad/s";
    spec.frame = "world (angular velocity: body)";
    spec.description = "Free joint of the body: position, quaternion, linear and angular velocity.";
    add_field(fmt::format("actors/{}", actor), spec, init.num_worlds);
  }
  SensorSpec spec;
  spec.shape = {length_};
  spec.unit = "rad or m, rad/s or m/s";
  spec.description = "qpos of the robot's move groups in order, then their qvel, then zeros.";
  add_field(fmt::format("articulations/{}", articulation_), spec, init.num_worlds);
}

void EnvStatesSensor::compute(const World& world) {
  const mjData* d = world.data;
  for (std::size_t i = 0; i < actors_.size(); ++i) {
    const auto row = fields()[i].data.row<float>(world.id);
    for (int k = 0; k < 7; ++k) row[k] = static_cast<float>(d->qpos[actors_[i].qpos + k]);
    for (int k = 0; k < 6; ++k) row[7 + k] = static_cast<float>(d->qvel[actors_[i].dof + k]);
  }
  const auto row = fields().back().data.row<float>(world.id);
  std::size_t n = 0;
  for (const JointGroup& group : groups_) {
    for (int address : group.qpos) row[n++] = static_cast<float>(d->qpos[address]);
  }
  for (const JointGroup& group : groups_) {
    for (int address : group.dof) row[n++] = static_cast<float>(d->qvel[address]);
  }
  std::fill(row.begin() + n, row.end(), 0.0f);
}

}  // namespace mjsense
