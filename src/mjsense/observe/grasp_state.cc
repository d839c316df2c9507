#include "mjsense/observe/grasp_state.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"

namespace mjsense {

GraspStateSensor::GraspStateSensor(std::string name, std::string object_body,
                                   std::vector<Gripper> grippers, int str_max_len)
    : JsonSensor(std::move(name), str_max_len,
                 "Whether each gripper touches and holds the object."),
      object_body_(std::move(object_body)),
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
  const auto geoms_below = [&](const std::string& body) {
    const std::vector<char> bodies = subtree(m, object_id(m, mjOBJ_BODY, place, body));
    std::vector<char> geoms(m->ngeom);
    for (int g = 0; g < m->ngeom; ++g) geoms[g] = bodies[m->geom_bodyid[g]];
    return geoms;
  };
  object_ = geoms_below(object_body_);
  gripper_bits_.assign(m->ngeom, 0);
  for (std::size_t i = 0; i < grippers_.size(); ++i) {
    const std::vector<char> geoms = geoms_below(grippers_[i].body);
    for (int g = 0; g < m->ngeom; ++g) gripper_bits_[g] |= geoms[g] ? 1u << i : 0u;
  }
}

void GraspStateSensor::write(const World& world, JsonWriter& json) {
  std::uint32_t touching = 0;
  bool foreign = false;
  const mjData* d = world.data;
  for (int c = 0; c < d->ncon; ++c) {
    const mjContact& contact = d->contact[c];
    const int a = contact.geom[0], b = contact.geom[1];
    if (contact.exclude != 0 || a < 0 || b < 0 || object_[a] == object_[b]) continue;
    const std::uint32_t bits = gripper_bits_[object_[a] ? b : a];
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
