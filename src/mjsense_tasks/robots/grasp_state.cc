// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/grasp_state.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"
#include "mjsense/observe/touches.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::robots {

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
  gripper_bits_.assign(m->nbody, 0);
  clear_fields();
  for (std::size_t i = 0; i < grippers_.size(); ++i) {
    const int root = scene::resolve(m, mjOBJ_BODY, grippers_[i].body, context);
    for (int b = 0; b < m->nbody; ++b) {
      if (observe::is_descendant_or_self(m, b, root)) gripper_bits_[b] |= 1u << i;
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
  observe::each_touch(world, object_(world.id), [&](const observe::Touch& touch) {
    const std::uint32_t bits = gripper_bits_[touch.other];
    touching |= bits;
    foreign |= bits == 0;
  });
  for (std::size_t i = 0; i < grippers_.size(); ++i) {
    const bool touches = touching >> i & 1u;
    fields()[2 * i].data.row<bool>(world.id)[0] = touches && !foreign;
    fields()[2 * i + 1].data.row<bool>(world.id)[0] = touches;
  }
}

}  // namespace mjsense::tasks::robots
