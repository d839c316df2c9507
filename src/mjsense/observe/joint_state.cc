// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/joint_state.h"

#include <fmt/format.h>

#include <algorithm>

namespace mjsense::observe {

JointStateSensor::JointStateSensor(std::string name, What what, std::vector<JointGroup> groups)
    : Sensor(std::move(name)), what_(what), groups_(std::move(groups)) {}

void JointStateSensor::initialize(const SensorInit& init) {
  const bool position = what_ == What::kPosition;
  clear_fields();
  for (const JointGroup& group : groups_) {
    SensorSpec spec;
    spec.shape = {static_cast<std::int64_t>(addresses(group).size())};
    spec.unit = joint_unit(init.model, group, position ? "" : "/s");
    spec.description = fmt::format("Joint {} of move group '{}'.",
                                   position ? "positions" : "velocities", group.name);
    add_field(group.name, spec, init.num_worlds);
  }
}

void JointStateSensor::compute(const World& world) {
  const mjtNum* source = what_ == What::kPosition ? world.data->qpos : world.data->qvel;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    std::ranges::transform(addresses(groups_[g]), fields()[g].data.row<float>(world.id).begin(),
                           [&](int address) { return static_cast<float>(source[address]); });
  }
}

std::string joint_unit(const mjModel* model, const JointGroup& group, std::string_view per) {
  bool turns = false, slides = false;
  for (int dof : group.dof) {
    const int joint = model->dof_jntid[dof], type = model->jnt_type[joint];
    // The first three degrees of freedom of a free joint are linear.
    const bool linear =
        type == mjJNT_SLIDE || (type == mjJNT_FREE && dof < model->jnt_dofadr[joint] + 3);
    (linear ? slides : turns) = true;
  }
  std::string unit = turns ? fmt::format("rad{}", per) : "";
  if (slides) unit += fmt::format("{}m{}", turns ? " or " : "", per);
  return unit;
}

}  // namespace mjsense::observe
