// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/env_states.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::observe {
namespace {

constexpr const char* kWhileAbsent = " While the body is absent: zeros, and NaN in a recording.";

}  // namespace

EnvStatesSensor::EnvStatesSensor(std::string name, std::string articulation,
                                 std::vector<JointGroup> groups, int length, std::string robot_body,
                                 std::string robot, Presence presence)
    : Sensor(std::move(name)),
      articulation_(std::move(articulation)),
      robot_(std::move(robot)),
      groups_(std::move(groups)),
      length_(length),
      robot_body_(std::move(robot_body)),
      presence_(std::move(presence)) {
  int needed = 0;
  for (const JointGroup& group : groups_)
    needed += static_cast<int>(group.qpos.size() + group.dof.size());
  if (length_ == 0) length_ = needed;
  if (!articulation_.empty() && length_ < needed) {
    throw ValueError(fmt::format("sensor '{}': articulation '{}' needs {} numbers, length is {}",
                                 this->name(), articulation_, needed, length_));
  }
}

std::vector<std::pair<int, std::string>> actors_of(const mjModel* m, int robot) {
  std::vector<std::pair<int, std::string>> found;
  std::vector<std::string> last;
  for (int j = 0; j < m->njnt; ++j) {
    const int body = m->jnt_bodyid[j];
    if (m->jnt_type[j] != mjJNT_FREE) continue;
    if (robot >= 0 && is_descendant_or_self(m, body, robot)) continue;
    const char* name = mj_id2name(m, mjOBJ_BODY, body);
    found.emplace_back(body, name ? name : fmt::format("body_{}", body));
    last.push_back(found.back().second.substr(found.back().second.rfind('/') + 1));
  }
  for (std::size_t i = 0; i < found.size(); ++i) {
    std::string& actor = found[i].second;
    if (std::ranges::count(last, last[i]) == 1) actor = last[i];
    std::ranges::replace(actor, '/', '_');
  }
  return found;
}

// Kinematic trees with a joint that is not free, and the robot's tree.
std::vector<EnvStatesSensor::Articulation> EnvStatesSensor::find_articulations(
    const mjModel* m, int robot_body) const {
  std::vector<Articulation> found;
  const int robot_root = robot_body < 0 ? -1 : m->body_rootid[robot_body];
  for (int root = 1; root < m->nbody; ++root) {
    if (m->body_rootid[root] != root) continue;
    Articulation each;
    bool inside = root == robot_root;
    for (int j = 0; j < m->njnt; ++j) {
      if (m->body_rootid[m->jnt_bodyid[j]] != root) continue;
      const int type = m->jnt_type[j];
      inside |= type != mjJNT_FREE;
      if (type == mjJNT_FREE && std::ranges::count(presence_.bodies, m->jnt_bodyid[j]) > 0)
        each.body = m->jnt_bodyid[j];
      const int nq = type == mjJNT_FREE ? 7 : type == mjJNT_BALL ? 4 : 1;
      const int nv = type == mjJNT_FREE ? 6 : type == mjJNT_BALL ? 3 : 1;
      for (int k = 0; k < nq; ++k) each.qpos.push_back(m->jnt_qposadr[j] + k);
      for (int k = 0; k < nv; ++k) each.dof.push_back(m->jnt_dofadr[j] + k);
    }
    if (!inside || each.qpos.empty()) continue;
    const char* name = mj_id2name(m, mjOBJ_BODY, root);
    each.name = root == robot_root ? robot_ : name ? name : fmt::format("body_{}", root);
    std::ranges::replace(each.name, '/', '_');
    found.push_back(std::move(each));
  }
  return found;
}

void EnvStatesSensor::initialize(const SensorInit& init) {
  const mjModel* m = init.model;
  const int robot = robot_body_.empty() ? -1
                                        : scene::resolve(m, mjOBJ_BODY, robot_body_,
                                                         fmt::format("sensor '{}'", name()));
  clear_fields();
  actors_.clear();
  for (const auto& [body, actor] : actors_of(m, robot)) {
    const bool leaves = std::ranges::count(presence_.bodies, body) > 0;
    const int j = m->body_jntadr[body];
    actors_.push_back({m->jnt_qposadr[j], m->jnt_dofadr[j], leaves ? body : -1});
    SensorSpec spec;
    spec.shape = {13};
    spec.unit = "m, wxyz, m/s, rad/s";
    spec.frame = "world (angular velocity: body)";
    spec.description = "Free joint of the body: position, quaternion, linear and angular velocity.";
    if (leaves) spec.description += kWhileAbsent;
    add_field(fmt::format("actors/{}", actor), spec, init.num_worlds);
  }
  articulations_.clear();
  if (!robot_.empty()) articulations_ = find_articulations(m, robot);
  for (const Articulation& each : articulations_) {
    SensorSpec spec;
    spec.dtype = DType::kFloat64;
    spec.shape = {static_cast<std::int64_t>(each.qpos.size() + each.dof.size())};
    spec.unit = "rad or m, rad/s or m/s";
    spec.description = "qpos of all its joints in the model's order, then their qvel.";
    if (each.body >= 0) spec.description += kWhileAbsent;
    add_field(fmt::format("articulations/{}", each.name), spec, init.num_worlds);
  }
  if (!articulation_.empty()) {
    SensorSpec spec;
    spec.shape = {length_};
    spec.unit = "rad or m, rad/s or m/s";
    spec.description = "qpos of the robot's move groups in order, then their qvel, then zeros.";
    add_field(fmt::format("articulations/{}", articulation_), spec, init.num_worlds);
  }
  for (std::size_t i = 0; i < actors_.size(); ++i) {
    if (actors_[i].body < 0) continue;
    const std::string actor = fields()[i].name.substr(std::string_view("actors/").size());
    actors_[i].field = flag_of(actor, init.num_worlds);
  }
  for (Articulation& each : articulations_) {
    if (each.body >= 0) each.field = flag_of(each.name, init.num_worlds);
  }
}

// The field "present/<name>", which is added unless it exists.
int EnvStatesSensor::flag_of(const std::string& name, int num_worlds) {
  const std::string flag = "present/" + name;
  const auto found = std::ranges::find(fields(), flag, &Field::name);
  if (found != fields().end()) return static_cast<int>(found - fields().begin());
  SensorSpec spec;
  spec.dtype = DType::kBool;
  spec.shape = {};
  spec.description = "Whether the body takes part in the episode.";
  add_field(flag, spec, num_worlds);
  return static_cast<int>(fields().size()) - 1;
}

bool EnvStatesSensor::note_presence(int world, int body, int flag) {
  if (body < 0) return true;
  const bool present = presence_.present(world, body);
  fields()[flag].data.row<bool>(world)[0] = present;
  return present;
}

void EnvStatesSensor::compute(const World& world) {
  const mjData* d = world.data;
  for (std::size_t i = 0; i < actors_.size(); ++i) {
    const auto row = fields()[i].data.row<float>(world.id);
    if (!note_presence(world.id, actors_[i].body, actors_[i].field)) {
      std::ranges::fill(row, 0.0f);
      continue;
    }
    for (int k = 0; k < 7; ++k) row[k] = static_cast<float>(d->qpos[actors_[i].qpos + k]);
    for (int k = 0; k < 6; ++k) row[7 + k] = static_cast<float>(d->qvel[actors_[i].dof + k]);
  }
  for (std::size_t i = 0; i < articulations_.size(); ++i) {
    const Articulation& each = articulations_[i];
    const auto row = fields()[actors_.size() + i].data.row<double>(world.id);
    if (!note_presence(world.id, each.body, each.field)) {
      std::ranges::fill(row, 0.0);
      continue;
    }
    std::size_t n = 0;
    for (int address : each.qpos) row[n++] = d->qpos[address];
    for (int address : each.dof) row[n++] = d->qvel[address];
  }
  if (articulation_.empty()) return;
  const auto row = fields()[actors_.size() + articulations_.size()].data.row<float>(world.id);
  std::size_t n = 0;
  for (const JointGroup& group : groups_) {
    for (int address : group.qpos) row[n++] = static_cast<float>(d->qpos[address]);
  }
  for (const JointGroup& group : groups_) {
    for (int address : group.dof) row[n++] = static_cast<float>(d->qvel[address]);
  }
  std::fill(row.begin() + n, row.end(), 0.0f);
}

}  // namespace mjsense::observe
