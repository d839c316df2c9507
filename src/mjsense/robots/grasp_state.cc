#include "mjsense/observe/grasp_state.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"

namespace mjsense {

GraspStateSensor::GraspStateSensor(std::string name, BodyRef object, std::vector<Gripper> grippers,
                                   int str_max_len)
    : JsonSensor(std::move(name), str_max_len,
                 "Whether each gripper touches and holds the object."),
      object_(std::move(object)),
      grippers_(std::move(grippers)) {
  if (grippers_.size() > kMaxGrippers) {
    throw ValueError(fmt::format("sensor '{}': {} grippers, at most {}", this->name(),
                                 grippers_.size(), kMaxGrippers));
  }
  std::ranges::sort(grippers_, {}, &Gripper::name);
}

void GraspStateSensor::prepare(const SensorInit& init) {
  const mjModel* m = init.model;
  const std::string place = fmt::format("sensor '{}'", name());
  object_.resolve(m, place);
  gripper_bits_.assign(m->ngeom, 0);
  for (std::size_t i = 0; i < grippers_.size(); ++i) {
    const int root = object_id(m, mjOBJ_BODY, place, grippers_[i].body);
    for (int g = 0; g < m->ngeom; ++g) {
      if (is_below(m, m->geom_bodyid[g], root)) gripper_bits_[g] |= 1u << i;
    }
  }
}

void GraspStateSensor::write(const World& world, JsonWriter& json) {
  std::uint32_t touching = 0;
  bool foreign = false;
  const mjModel* m = world.model;
  const mjData* d = world.data;
  const int root = object_(world.id);
  const auto in_object = [&](int geom) { return is_below(m, m->geom_bodyid[geom], root); };
  for (int c = 0; root >= 0 && c < d->ncon; ++c) {
    const mjContact& contact = d->contact[c];
    const int a = contact.geom[0], b = contact.geom[1];
    if (contact.exclude != 0 || a < 0 || b < 0 || in_object(a) == in_object(b)) continue;
    const std::uint32_t bits = gripper_bits_[in_object(a) ? b : a];
    touching |= bits;
    foreign |= bits == 0;
  }
  json.begin_object();
  for (std::size_t i = 0; i < grippers_.size(); ++i) {
    const bool touches = touching >> i & 1u;
    json.key(grippers_[i].name).begin_object();
    json.key("held").value(touches && !foreign);
    json.key("touching").value(touches);
    json.end_object();
  }
  json.end_object();
}

std::size_t GraspStateSensor::max_bytes() const {
  std::size_t bytes = 2;
  for (const Gripper& g : grippers_) bytes += g.name.size() + 36;
  return bytes;
}

}  // namespace mjsense
