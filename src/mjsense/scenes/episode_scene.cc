// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/episode_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/name_matching.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/model_parts.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scenes/entity_model.h"
#include "mjsense/scenes/final_spec_edits.h"
#include "mjsense/scenes/generators/generator.h"

namespace mjsense {
namespace {

using std::numbers::pi;

constexpr double kHand = 0.085;    // m, opening of common grippers
constexpr double kBeside = 0.005;  // m, minimum difference between an opening and an object's width
constexpr double kReach = 0.25;    // m, maximum radius of an object that can be carried
constexpr double kInside = 0.002;  // m
constexpr double kAway = 100;      // m, x and y of absent objects
// Pose of an absent object: out of sight, one metre from other absent objects.
Pose away(int object) { return {{kAway + object, kAway, 0.5}, {}}; }

Quat rest_of(std::string_view name) {
  if (name == "side") return axis_angle({0, 1, 0}, 0.5 * pi);
  if (name == "end") return axis_angle({1, 0, 0}, 0.5 * pi);
  return {};
}

std::string last_part(const std::string& name) { return name.substr(name.rfind('/') + 1); }

bool is_free(const mjModel* m, int body) {
  return m->body_jntnum[body] == 1 && m->jnt_type[m->body_jntadr[body]] == mjJNT_FREE;
}

bool touches(const mjModel* m, int body) {
  for (int g = 0; g < m->ngeom; ++g) {
    const bool solid = m->geom_contype[g] != 0 || m->geom_conaffinity[g] != 0;
    if (solid && is_descendant_or_self(m, m->geom_bodyid[g], body)) return true;
  }
  return false;
}

// Smallest horizontal or vertical extent of a shape, m.
double min_extent(const ObjectShape& shape) {
  double low[3] = {1e10, 1e10, 1e10}, high[3] = {-1e10, -1e10, -1e10};
  for (Vec3 p : shape.points) {
    for (int i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], p[i]);
      high[i] = std::max(high[i], p[i]);
    }
  }
  double minimum = 1e10;
  for (int i = 0; i < 3; ++i) minimum = std::min(minimum, high[i] - low[i]);
  return minimum;
}

// A gripper grasps an object at its smallest extent.
bool can_be_held(const ObjectShape& shape) {
  return min_extent(shape) <= kHand && shape.reach <= kReach;
}

// A static box with horizontal top; any of its axes may be vertical.
struct LevelBox {
  int geom = -1;
  double x = 0, y = 0, top = 0;  // centre and height of its top
  double wide = 0, deep = 0;     // half sizes of the top along x and y
};

std::optional<LevelBox> level_box(const mjModel* m, int g) {
  if (m->geom_type[g] != mjGEOM_BOX) return {};
  Pose pose{vec3(m->geom_pos + 3 * g), quat(m->geom_quat + 4 * g)};
  for (int body = m->geom_bodyid[g]; body > 0; body = m->body_parentid[body]) {
    if (m->body_jntnum[body] > 0) return {};
    pose = Pose{vec3(m->body_pos + 3 * body), quat(m->body_quat + 4 * body)} * pose;
  }
  const double* half = m->geom_size + 3 * g;
  LevelBox box{.geom = g, .x = pose.p.x, .y = pose.p.y, .top = pose.p.z};
  bool level = false;
  for (const Vec3 axis : {Vec3{half[0], 0, 0}, Vec3{0, half[1], 0}, Vec3{0, 0, half[2]}}) {
    const Vec3 edge = rotate(pose.q, axis);
    if (std::abs(edge.x) + std::abs(edge.y) < 1e-9) {
      level = true;
      box.top += std::abs(edge.z);
    } else {
      box.wide += std::abs(edge.x);
      box.deep += std::abs(edge.y);
    }
  }
  return level ? std::optional(box) : std::nullopt;
}

// The highest box of a body and its descendants; the largest one if several are equally high.
std::optional<LevelBox> highest_box(const mjModel* m, int body) {
  std::optional<LevelBox> best;
  const auto larger = [](const LevelBox& a, const LevelBox& b) {
    return std::abs(a.top - b.top) > 1e-6 ? a.top > b.top : a.wide * a.deep > b.wide * b.deep;
  };
  for (int g = 0; g < m->ngeom; ++g) {
    int at = m->geom_bodyid[g];
    while (at > body) at = m->body_parentid[at];
    if (at != body) continue;
    const std::optional<LevelBox> box = level_box(m, g);
    if (box && (!best || larger(*box, *best))) best = box;
  }
  return best;
}

// Finds the surface that a region names: a geom or a body.
LevelBox surface_named(const mjModel* m, const std::string& name, const std::string& who) {
  const int body = mj_name2id(m, mjOBJ_BODY, name.c_str());
  const bool of_body = body > 0 && mj_name2id(m, mjOBJ_GEOM, name.c_str()) < 0;
  const std::optional<LevelBox> box =
      of_body ? highest_box(m, body) : level_box(m, resolve(m, mjOBJ_GEOM, name, who));
  if (box) return *box;
  throw ValueError(of_body ? fmt::format("{}: body '{}' has no level, fixed box", who, name)
                           : fmt::format("{}: geom '{}' must be a level, fixed box", who, name));
}

}  // namespace

EpisodeScene::EpisodeScene(SceneFileCfg cfg) : cfg_(std::move(cfg)) {
  check_fields(cfg_, "");
  if (!cfg_.generator.empty()) generated_ = generate(cfg_);
  for (const SceneEntityCfg& entity : cfg_.entities)
    edited_.push_back(edited_model(entity, context()));
  make_meshes();
}

// If the scene names no objects, they are found after compilation, so every body with a free joint
// may be one.
void EpisodeScene::make_meshes() {
  std::vector<ObjectMeshes::Object> objects;
  for (const SceneObjectCfg& one : cfg_.objects) {
    const std::vector<double> sizes = ObjectSizes::steps(one.sizes.value_or(cfg_.sizes));
    if (sizes.size() > 1) objects.push_back({one.body, sizes});
  }
  const bool found = cfg_.objects.empty() && cfg_.sizes[0] < cfg_.sizes[1];
  if (objects.empty() && !found) return;
  SceneCfg things = scene_cfg("");
  // Removes entities whose models were generated for this scene only.
  std::erase_if(things.entities, [&](const auto& entity) {
    return entity.first.empty() || (entity.first == "room" && !generated_.empty());
  });
  things.spec_fn = {};
  if (found) {
    const Scene scene(things);
    for (int body = 1; body < scene.model()->nbody; ++body) {
      if (is_free(scene.model(), body))
        objects.push_back(
            {name_of(scene.model(), mjOBJ_BODY, body), ObjectSizes::steps(cfg_.sizes)});
    }
  }
  meshes_ = std::make_shared<ObjectMeshes>(std::move(things), objects);
}

std::string EpisodeScene::context() const { return fmt::format("scene '{}'", cfg_.name); }

SceneCfg EpisodeScene::scene_cfg(const std::string& robot) const {
  SceneCfg scene;
  if (cfg_.models) scene = cfg_.models();
  if (!cfg_.base.empty()) scene.base.path = cfg_.base;
  if (!generated_.empty()) {
    EntityCfg room;
    room.model = generated_;
    room.mocap_base = false;
    scene.entities.emplace_back("room", room);
    scene.entities.emplace_back(robot, EntityCfg{});
  }
  for (std::size_t i = 0; i < cfg_.entities.size(); ++i) {
    const SceneEntityCfg& one = cfg_.entities[i];
    EntityCfg entity;
    if (edited_[i]) {
      entity.model.spec = edited_[i].get();
    } else {
      entity.model.path = model_path(one.model, context());
    }
    entity.pos = one.pos;
    entity.quat = one.quat;
    // Many objects at the same position would cause thousands of contacts before the first episode.
    if (is_placed(one)) {
      const Vec3 p = away(static_cast<int>(i)).p;
      entity.pos = {p.x, p.y, p.z};
    }
    scene.entities.emplace_back(one.name, entity);
    if (scene.entities.size() == 1) scene.entities.emplace_back(robot, EntityCfg{});
  }
  if (scene.entities.empty()) scene.entities.emplace_back(robot, EntityCfg{});
  if (cfg_.extent) scene.extent = cfg_.extent;
  if (!cfg_.models) scene.options = cfg_.options;
  scene.spec_fn = [cfg = cfg_, first = scene.spec_fn, meshes = meshes_, robot](mjSpec* spec) {
    finish_spec(spec, cfg, robot);
    if (meshes) meshes->add(spec);
    if (first) first(spec);
  };
  return scene;
}

void EpisodeScene::initialize(const mjModel* model, int num_worlds, std::string_view robot_prefix) {
  model_ = model;
  find_objects(robot_prefix);
  find_regions();
  find_furniture();
  present_.assign(num_worlds * objects_.size(), 1);
  steps_.assign(num_worlds * objects_.size(), -1);
  support_.assign(num_worlds, regions_.empty() ? 0.0 : regions_[0].height);
  make_sizes();
}

void EpisodeScene::bind(Simulation& simulation) {
  simulation_ = &simulation;
  if (!cfg_.vary.empty())
    variation_ = std::make_unique<SceneVariation>(cfg_.vary, simulation, context());
  make_sizes();
}

// Needs both the worlds and the objects, which are set by different calls in any order.
void EpisodeScene::make_sizes() {
  if (!meshes_ || !simulation_ || objects_.empty()) return;
  std::vector<int> bodies;
  std::vector<std::vector<double>> sizes;
  for (const SceneObject& object : objects_) {
    bodies.push_back(object.body);
    sizes.push_back(object.sizes);
  }
  sizes_ = std::make_unique<ObjectSizes>(*simulation_, bodies, std::move(sizes), context());
}

const ObjectShape& EpisodeScene::shape(int world, int object) const {
  const int step = steps_[world * objects_.size() + object];
  return step < 0 ? objects_[object].shape : objects_[object].shapes[step];
}

double EpisodeScene::size(int world, int object) const {
  const int step = steps_[world * objects_.size() + object];
  return step < 0 ? 1.0 : objects_[object].sizes[step];
}

bool EpisodeScene::is_placed(const SceneEntityCfg& entity) const {
  return entity.free && !cfg_.regions.empty() && entity.pos == std::array<double, 3>{};
}

void EpisodeScene::find_objects(std::string_view robot_prefix) {
  collect_objects(robot_prefix);
  for (const SceneEntityCfg& entity : cfg_.entities) {
    const auto of_entity = [&](const SceneObject& object) {
      return name_of(model_, mjOBJ_BODY, object.body).starts_with(entity.name + "/");
    };
    if (is_placed(entity) && std::ranges::none_of(objects_, of_entity)) {
      throw ValueError(fmt::format(
          "{}: entity '{}' is {}, so its position is undefined: set its pos, or remove it",
          context(), entity.name,
          cfg_.objects.empty() ? "not graspable" : "not among the objects"));
    }
  }
}

void EpisodeScene::collect_objects(std::string_view robot_prefix) {
  objects_.clear();
  const auto found = [&](int body, std::string kind, const std::array<double, 2>& sizes) {
    SceneObject object;
    object.body = body;
    object.kind = std::move(kind);
    object.shape = object_shape(model_, body);
    object.sizes = ObjectSizes::steps(sizes);
    if (meshes_) {
      for (double size : object.sizes) object.shapes.push_back(scaled(object.shape, size));
    }
    return object;
  };
  for (const SceneObjectCfg& one : cfg_.objects) {
    const int body = resolve(model_, mjOBJ_BODY, one.body, context());
    if (!is_free(model_, body))
      throw ValueError(fmt::format("{}: object '{}' has no free joint", context(), one.body));
    SceneObject object = found(body, last_part(one.body), one.sizes.value_or(cfg_.sizes));
    object.text = one.text;
    object.others = one.other_texts;
    if (object.text.empty()) object.text = object.kind;
    object.receptacle = one.receptacle;
    object.color = one.color;
    for (const std::string& rest : one.rests) object.rests.push_back(rest_of(rest));
    objects_.push_back(std::move(object));
  }
  if (!cfg_.objects.empty()) return;
  for (int body = 1; body < model_->nbody; ++body) {
    const std::string name = name_of(model_, mjOBJ_BODY, body);
    if (!is_free(model_, body) || name.empty() || name.starts_with(robot_prefix)) continue;
    if (!touches(model_, body)) continue;
    SceneObject object = found(body, last_part(name), cfg_.sizes);
    object.rests = {Quat{}};
    if (!can_be_held(object.shape)) continue;
    object.text = object.kind;
    std::ranges::replace(object.text, '_', ' ');
    objects_.push_back(std::move(object));
  }
}

void EpisodeScene::find_regions() {
  regions_.clear();
  region_bodies_.clear();
  for (const SceneRegionCfg& one : cfg_.regions) {
    const LevelBox on =
        surface_named(model_, one.on, fmt::format("{}, region '{}'", context(), one.name));
    const auto area = [](const std::array<double, 4>& a) { return Area{a[0], a[1], a[2], a[3]}; };
    Region region{};
    region.height = on.top;
    region.area = one.area == std::array<double, 4>{}
                      ? Area{on.x - on.wide, on.x + on.wide, on.y - on.deep, on.y + on.deep}
                      : area(one.area);
    region.target_area = one.target_area ? area(*one.target_area) : region.area;
    regions_.push_back(region);
    region_bodies_.push_back(model_->geom_bodyid[on.geom]);
  }
}

void EpisodeScene::set_target_regions(std::span<const char> flags) {
  for (std::size_t i = 0; i < regions_.size(); ++i) regions_[i].for_targets = flags[i] != 0;
}

// Regions at the current positions of the furniture in this world.
std::vector<Region> EpisodeScene::regions_of(int world) const {
  std::vector<Region> regions = regions_;
  const double* here = variation_ ? variation_->body_pos(world) : model_->body_pos;
  if (here == model_->body_pos) return regions;
  for (std::size_t i = 0; i < regions.size(); ++i) {
    Vec3 move;
    for (int body = region_bodies_[i]; body > 0; body = model_->body_parentid[body])
      move = move + vec3(here + 3 * body) - vec3(model_->body_pos + 3 * body);
    for (Area* area : {&regions[i].area, &regions[i].target_area}) {
      area->x0 += move.x;
      area->x1 += move.x;
      area->y0 += move.y;
      area->y1 += move.y;
    }
    regions[i].height += move.z;
  }
  return regions;
}

// As SceneVariation does: of two that name a body the second counts.
void EpisodeScene::find_furniture() {
  furniture_.clear();
  for (const SceneVaryCfg& one : cfg_.vary) {
    if (one.what != VaryKind::kBody) continue;
    const Regex pattern(one.pattern, context());
    for (int body = 1; body < model_->nbody; ++body) {
      if (pattern.fullmatch(name_of(model_, mjOBJ_BODY, body)))
        furniture_.insert_or_assign(body, one);
    }
  }
}

std::vector<Pose> EpisodeScene::elsewhere(int geom) const {
  std::vector<Pose> moves;
  for (int body = model_->geom_bodyid[geom]; body > 0; body = model_->body_parentid[body]) {
    const auto one = furniture_.find(body);
    if (one == furniture_.end()) continue;
    const Pose here{vec3(model_->body_pos + 3 * body), quat(model_->body_quat + 4 * body)};
    Pose parent;
    for (int p = model_->body_parentid[body]; p > 0; p = model_->body_parentid[p])
      parent = Pose{vec3(model_->body_pos + 3 * p), quat(model_->body_quat + 4 * p)} * parent;
    if (moves.empty()) moves.emplace_back();
    std::vector<Pose> all;
    for (const double turn : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
      if (turn != 0 && one->second.angle == 0) continue;
      for (int corner = 0; corner < 8; ++corner) {
        const auto& by = one->second.pos;
        const Vec3 move{corner & 1 ? by[0] : -by[0], corner & 2 ? by[1] : -by[1],
                        corner & 4 ? by[2] : -by[2]};
        const Pose there{here.p + move,
                         axis_angle({0, 0, 1}, turn * one->second.angle * pi / 180) * here.q};
        const Pose moved = parent * there * inverse(parent * here);
        for (const Pose& before : moves) all.push_back(moved * before);
      }
    }
    moves = std::move(all);
  }
  return moves;
}

int EpisodeScene::draw(int world, std::span<const int> of, const Robot& robot, Rng& rng) const {
  double opening = 0;
  for (const MoveGroup& group : robot.groups()) opening = std::max(opening, group.max_opening);
  const auto fits = [&](int i) { return min_extent(shape(world, i)) <= opening - kBeside; };
  const bool some = std::ranges::any_of(of, fits);
  for (;;) {
    const int drawn = of[rng.below(static_cast<std::uint32_t>(of.size()))];
    if (fits(drawn) || !some) return drawn;
  }
}

std::vector<int> EpisodeScene::where(bool receptacle) const {
  std::vector<int> found;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (objects_[i].receptacle == receptacle) found.push_back(static_cast<int>(i));
  }
  return found;
}

// Places an object at rest.
void EpisodeScene::put(int object, const Pose& pose, const StateRow& state) const {
  const int joint = model_->body_jntadr[objects_[object].body];
  double* qpos = state.qpos + model_->jnt_qposadr[joint];
  double* qvel = state.qvel + model_->jnt_dofadr[joint];
  write_vec(pose.p, qpos);
  write_quat(pose.q, qpos + 3);
  std::fill(qvel, qvel + 6, 0.0);
}

Pose EpisodeScene::clear(const StateRow& state) const {
  for (std::size_t i = 0; i < objects_.size() && !regions_.empty(); ++i)
    put(static_cast<int>(i), away(static_cast<int>(i)), state);
  const SceneRobotCfg& r = cfg_.robot;
  return {vec3(r.pos.data()), r.yaw == 0 ? Quat{} : axis_angle({0, 0, 1}, r.yaw * pi / 180)};
}

Pose EpisodeScene::sample(int world, int target, std::uint64_t seed, std::uint64_t episode,
                          Rng& rng, const StateRow& state) {
  return sample(world, std::span(&target, target >= 0 ? 1u : 0u), seed, episode, rng, state);
}

Pose EpisodeScene::sample(int world, std::span<const int> wanted, std::uint64_t seed,
                          std::uint64_t episode, Rng& rng, const StateRow& state) {
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
                                     const StateRow& state) {
  draw_sizes(world, seed, episode);
  std::vector<int> here;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const double* qpos = state.qpos + model_->jnt_qposadr[model_->body_jntadr[objects_[i].body]];
    char& present = present_[world * objects_.size() + i];
    present = qpos[1] < kAway ? 1 : 0;
    if (present) here.push_back(static_cast<int>(i));
  }
  return here;
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

void EpisodeScene::set_target(int world, int target, const StateRow& state) {
  const double* qpos = state.qpos + model_->jnt_qposadr[model_->body_jntadr[objects_[target].body]];
  const Pose pose{vec3(qpos), quat(qpos + 3)};
  support_[world] = std::numeric_limits<double>::max();
  for (Vec3 point : shape(world, target).points)
    support_[world] = std::min(support_[world], (pose * point).z);
}

bool EpisodeScene::vary(int world, std::uint64_t seed, std::uint64_t episode) {
  if (variation_) {
    Rng rng(seed, 0, stream_of("scene/look"), episode);
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
                         -1000 * contact.dist, name_of(m, mjOBJ_BODY, other));
    }
  }
  return "";
}

}  // namespace mjsense
