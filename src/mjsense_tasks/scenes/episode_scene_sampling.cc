// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "mjsense/core/model_geometry.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/scenes/absent_objects.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr double kInside = 0.002;  // m

}  // namespace

// Places an object at rest.
void EpisodeScene::put(int object, const Pose& pose, const robots::StateRow& state) const {
  const int joint = model_->body_jntadr[objects_[object].body];
  double* qpos = state.qpos + model_->jnt_qposadr[joint];
  double* qvel = state.qvel + model_->jnt_dofadr[joint];
  write_vec(pose.p, qpos);
  write_quat(pose.q, qpos + 3);
  std::fill(qvel, qvel + 6, 0.0);
}

Pose EpisodeScene::clear(const robots::StateRow& state) const {
  for (std::size_t i = 0; i < objects_.size() && !regions_.empty(); ++i)
    put(static_cast<int>(i), away(static_cast<int>(i)), state);
  const SceneRobotCfg& r = cfg_.robot;
  return {vec3(r.pos.data()), r.yaw == 0 ? Quat{} : axis_angle({0, 0, 1}, r.yaw * pi / 180)};
}

Pose EpisodeScene::sample(int world, int target, std::uint64_t seed, std::uint64_t episode,
                          Rng& rng, const robots::StateRow& state) {
  return sample(world, std::span(&target, target >= 0 ? 1u : 0u), seed, episode, rng, state);
}

Pose EpisodeScene::sample(int world, std::span<const int> wanted, std::uint64_t seed,
                          std::uint64_t episode, Rng& rng, const robots::StateRow& state) {
  const int target = wanted.empty() ? -1 : wanted[0];
  const auto n = static_cast<int>(objects_.size());
  char* present = present_.data() + static_cast<std::size_t>(world) * n;
  std::fill(present, present + n, 1);
  if (counts_objects()) {
    Rng draw(seed, 0, stream_of("scene/count"), episode);
    const int maximum = std::min(cfg_.count[1], n), minimum = std::min(cfg_.count[0], n);
    int many =
        minimum + static_cast<int>(draw.below(static_cast<std::uint32_t>(maximum - minimum + 1)));
    std::fill(present, present + n, 0);
    for (int i : wanted) present[i] = 1;
    many -= static_cast<int>(wanted.size());
    while (many-- > 0) {  // each of the other objects is equally likely
      int k = static_cast<int>(
          draw.below(static_cast<std::uint32_t>(std::count(present, present + n, 0))));
      for (int i = 0; i < n; ++i) {
        if (!present[i] && k-- == 0) present[i] = 1;
      }
    }
  }
  if (!regions_.empty() && n > 0) {
    const std::vector<Region> regions = regions_of(world);
    std::vector<PlacedObject> resting;
    std::vector<Pose> poses(n);
    std::vector<int> region_of(n);
    for (int i = 0; i < n; ++i) {
      resting.push_back({&shape(world, i), objects_[i].rests});
      poses[i] = away(i);
    }
    place_objects(resting, wanted, {present, static_cast<std::size_t>(n)}, regions,
                  {cfg_.gap, cfg_.target_gap, cfg_.drop}, rng, poses, region_of);
    std::vector<int> absent;
    for (int i = 0; i < n; ++i) {
      put(i, poses[i], state);
      if (!present[i]) absent.push_back(model_->body_jntadr[objects_[i].body]);
    }
    if (simulation_) simulation_->worlds().hold(world, absent);
    if (target >= 0) support_[world] = regions[region_of[target]].height;
  } else if (n > 0 && target >= 0) {
    set_target(world, target, state);
  }
  const SceneRobotCfg& r = cfg_.robot;
  Rng draw(seed, 0, stream_of("scene/robot"), episode);
  const auto around = [&](double half) { return half > 0 ? draw.uniform(-half, half) : 0.0; };
  const double x = r.pos[0] + around(r.pos_spread[0]), y = r.pos[1] + around(r.pos_spread[1]);
  const double yaw = r.yaw + around(r.yaw_spread);
  return {{x, y, r.pos[2]}, yaw == 0 ? Quat{} : axis_angle({0, 0, 1}, yaw * pi / 180)};
}

std::vector<int> EpisodeScene::adopt(int world, std::uint64_t seed, std::uint64_t episode,
                                     const robots::StateRow& state) {
  draw_sizes(world, seed, episode);
  std::vector<int> here;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const double* qpos = state.qpos + free_qpos(model_, objects_[i].body);
    char& present = present_[world * objects_.size() + i];
    present = qpos[1] < kAway ? 1 : 0;
    if (present) here.push_back(static_cast<int>(i));
  }
  return here;
}

void EpisodeScene::adopt(int world, std::uint64_t seed, std::uint64_t episode,
                         const episode::GivenStart& start, const robots::StateRow& state) {
  std::vector<char> has_pose(model_->nbody), is_absent(model_->nbody);
  for (const auto& [name, at] : start.bodies)
    has_pose[episode::find_name(model_, mjOBJ_BODY, name)] = 1;
  for (const std::string& name : start.absent) {
    const int body = episode::find_name(model_, mjOBJ_BODY, name);
    if (body >= 0) is_absent[body] = 1;
  }
  std::vector<int> absent;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const int body = objects_[i].body;
    if (!is_absent[body] && (has_pose[body] || regions_.empty())) continue;
    put(static_cast<int>(i), away(static_cast<int>(i)), state);
    absent.push_back(model_->body_jntadr[body]);
  }
  if (simulation_) simulation_->worlds().hold(world, absent);
  adopt(world, seed, episode, state);
}

bool EpisodeScene::counts_objects() const {
  return cfg_.count[0] > 0 && !objects_.empty() && !regions_.empty();
}

std::vector<int> EpisodeScene::absentees() const {
  std::vector<int> bodies;
  if (!counts_objects() || cfg_.count[0] >= static_cast<int>(objects_.size())) return bodies;
  for (const SceneObject& object : objects_) bodies.push_back(object.body);
  return bodies;
}

bool EpisodeScene::body_present(int world, int body) const {
  const auto object = std::ranges::find(objects_, body, &SceneObject::body);
  return object == objects_.end() || present(world, static_cast<int>(object - objects_.begin()));
}

void EpisodeScene::set_target(int world, int target, const robots::StateRow& state) {
  const double* qpos = state.qpos + free_qpos(model_, objects_[target].body);
  const Pose pose{vec3(qpos), quat(qpos + 3)};
  support_[world] = std::numeric_limits<double>::max();
  for (Vec3 point : shape(world, target).points)
    support_[world] = std::min(support_[world], (pose * point).z);
}

namespace {
Rng look_rng(std::uint64_t seed, std::uint64_t episode) {
  return {seed, 0, stream_of("scene/look"), episode};
}
}  // namespace

std::string EpisodeScene::mood(std::uint64_t seed, std::uint64_t episode) const {
  return variation_ ? variation_->mood(look_rng(seed, episode)) : std::string();
}

bool EpisodeScene::vary(int world, std::uint64_t seed, std::uint64_t episode) {
  if (variation_) {
    Rng rng = look_rng(seed, episode);
    variation_->vary(world, rng);
  }
  draw_sizes(world, seed, episode);
  const std::size_t n = objects_.size();
  if (sizes_) sizes_->set(world, std::span(steps_).subspan(world * n, n));
  return variation_ || sizes_;
}

void EpisodeScene::draw_sizes(int world, std::uint64_t seed, std::uint64_t episode) {
  if (!sizes_) return;
  Rng rng(seed, 0, stream_of("scene/sizes"), episode);
  for (std::size_t i = 0; i < objects_.size(); ++i)
    steps_[world * objects_.size() + i] =
        static_cast<int>(rng.below(static_cast<std::uint32_t>(objects_[i].sizes.size())));
}

std::string EpisodeScene::fault(const World& world) const {
  const mjModel* m = world.model;
  for (int i = 0; i < world.data->ncon; ++i) {
    const mjContact& contact = world.data->contact[i];
    if (contact.exclude || contact.dist > -kInside || contact.geom[0] < 0 || contact.geom[1] < 0)
      continue;
    const int a = m->geom_bodyid[contact.geom[0]], b = m->geom_bodyid[contact.geom[1]];
    for (std::size_t k = 0; k < objects_.size(); ++k) {
      if (!present(world.id, static_cast<int>(k))) continue;
      const int body = objects_[k].body;
      if (m->body_rootid[a] != body && m->body_rootid[b] != body) continue;
      const int other = m->body_rootid[a] == body ? b : a;
      return fmt::format("{}: '{}' starts {:.1f} mm inside '{}'", context(), objects_[k].kind,
                         -1000 * contact.dist, scene::name_of(m, mjOBJ_BODY, other));
    }
  }
  return "";
}

}  // namespace mjsense::tasks::scenes
