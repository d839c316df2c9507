// SPDX-License-Identifier: Apache-2.0
#include "mjsense/robots/grasp_state.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense::robots {

GraspStateSensor::GraspStateSensor(std::string name, observe::BodyRef object,
                                   std::vector<Gripper> grippers)
    : Sensor(std::move(name)), object_(std::move(object)), grippers_(std::move(grippers)) {
  if (grippers_.size() > kMaxGrippers) {
    throw ValueError(fmt::format("sensor '{}': {} grippers: the maximum is {}", this->name(),
                                 grippers_.size(), kMaxGrippers));
  }
}

void GraspStateSensor::initialize(const SensorInit& init) {
  const mjModel* m = init.model;
  const std::string context = fmt::format("sensor '{}'", name());
  object_.resolve(m, context);
  gripper_bits_.assign(m->ngeom, 0);
  clear_fields();
  for (std::size_t i = 0; i < grippers_.size(); ++i) {
    const int root = observe::object_id(m, mjOBJ_BODY, context, grippers_[i].body);
    for (int g = 0; g < m->ngeom; ++g) {
      if (observe::is_descendant_or_self(m, m->geom_bodyid[g], root)) gripper_bits_[g] |= 1u << i;
    }
    SensorSpec spec;
    spec.dtype = DType::kBool;
    spec.description = fmt::format(
        "'{}' touches the object, and nothing except grippers touches it.", grippers_[i].name);
    add_field(grippers_[i].name + "/held", spec, init.num_worlds);
    spec.description = fmt::format("'{}' touches the object.", grippers_[i].name);
    add_field(grippers_[i].name + "/touching", spec, init.num_worlds);
  }
}

void GraspStateSensor::compute(const World& world) {
  std::uint32_t touching = 0;
  bool foreign = false;
  const mjModel* m = world.model;
  const mjData* d = world.data;
  const int root = object_(world.id);
  const auto in_object = [&](int geom) {
    return observe::is_descendant_or_self(m, m->geom_bodyid[geom], root);
  };
  for (int c = 0; root >= 0 && c < d->ncon; ++c) {
    const mjContact& contact = d->contact[c];
    const int a = contact.geom[0], b = contact.geom[1];
    if (contact.exclude != 0 || a < 0 || b < 0 || in_object(a) == in_object(b)) continue;
    const std::uint32_t bits = gripper_bits_[in_object(a) ? b : a];
    touching |= bits;
    foreign |= bits == 0;
  }
  for (std::size_t i = 0; i < grippers_.size(); ++i) {
    const bool touches = touching >> i & 1u;
    fields()[2 * i].data.row<bool>(world.id)[0] = touches && !foreign;
    fields()[2 * i + 1].data.row<bool>(world.id)[0] = touches;
  }
}

}  // namespace mjsense::robots
