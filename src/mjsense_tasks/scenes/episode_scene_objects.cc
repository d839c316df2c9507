// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <span>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/model_parts.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr double kHand = 0.085;    // m, opening of common grippers
constexpr double kBeside = 0.005;  // m, minimum difference between an opening and an object's width
constexpr double kReach = 0.25;    // m, maximum radius of an object that can be carried

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
    if (is_solid(m, g) && observe::is_descendant_or_self(m, m->geom_bodyid[g], body)) return true;
  }
  return false;
}

// Smallest horizontal or vertical extent of a shape, m.
double min_extent(const episode::ObjectShape& shape) {
  const Vec3 size = aabb_of(shape.points).size();
  return std::min({size.x, size.y, size.z});
}

// Smallest horizontal extent of an object in its resting orientations, m. A hand closes horizontally
// on an object that lies on a support: a finger would have to be below a flat disc otherwise.
double min_width(const episode::ObjectShape& shape, std::span<const Quat> rests) {
  const Vec3 size = aabb_of(shape.points).size();
  double width = std::numeric_limits<double>::infinity();
  for (Quat rest : rests) {
    const Vec3 turned = rotate(rest, size);
    width = std::min({width, std::abs(turned.x), std::abs(turned.y)});
  }
  return width;
}

// A gripper grasps an object at its smallest extent.
bool can_be_held(const episode::ObjectShape& shape) {
  return min_extent(shape) <= kHand && shape.reach <= kReach;
}

}  // namespace

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
  scene::SceneCfg things = scene_cfg("");
  // Removes entities whose models were generated for this scene only.
  std::erase_if(things.entities, [&](const auto& entity) {
    return entity.first.empty() || (entity.first == "room" && !generated_.empty());
  });
  things.spec_fn = {};
  if (found) {
    const scene::Scene scene(things);
    for (int body = 1; body < scene.model()->nbody; ++body) {
      if (is_free(scene.model(), body))
        objects.push_back(
            {scene::name_of(scene.model(), mjOBJ_BODY, body), ObjectSizes::steps(cfg_.sizes)});
    }
  }
  meshes_ = std::make_shared<ObjectMeshes>(std::move(things), objects);
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

const episode::ObjectShape& EpisodeScene::shape(int world, int object) const {
  const int step = steps_[world * objects_.size() + object];
  return step < 0 ? objects_[object].shape : objects_[object].shapes[step];
}

double EpisodeScene::size(int world, int object) const {
  const int step = steps_[world * objects_.size() + object];
  return step < 0 ? 1.0 : objects_[object].sizes[step];
}

void EpisodeScene::find_objects(std::string_view robot_prefix) {
  collect_objects(robot_prefix);
  for (const SceneEntityCfg& entity : cfg_.entities) {
    const auto of_entity = [&](const SceneObject& object) {
      return scene::name_of(model_, mjOBJ_BODY, object.body).starts_with(entity.name + "/");
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
    object.shape = episode::object_shape(model_, body);
    object.sizes = ObjectSizes::steps(sizes);
    if (meshes_) {
      for (double size : object.sizes) object.shapes.push_back(episode::scaled(object.shape, size));
    }
    return object;
  };
  for (const SceneObjectCfg& one : cfg_.objects) {
    const int body = scene::resolve(model_, mjOBJ_BODY, one.body, context());
    if (!is_free(model_, body))
      throw ValueError(fmt::format("{}: object '{}' has no free joint", context(), one.body));
    SceneObject object = found(body, last_part(one.body), one.sizes.value_or(cfg_.sizes));
    object.text = one.text;
    object.others = one.other_texts;
    if (object.text.empty()) object.text = object.kind;
    object.receptacle = one.receptacle;
    object.color = one.color;
    object.material = one.material;
    for (const std::string& rest : one.rests) object.rests.push_back(rest_of(rest));
    objects_.push_back(std::move(object));
  }
  if (!cfg_.objects.empty()) return;
  for (int body = 1; body < model_->nbody; ++body) {
    const std::string name = scene::name_of(model_, mjOBJ_BODY, body);
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

int EpisodeScene::draw(int world, std::span<const int> of, const robots::Robot& robot,
                       Rng& rng) const {
  double opening = 0;
  for (const robots::MoveGroup& group : robot.groups())
    opening = std::max(opening, group.max_opening);
  const auto fits = [&](int i) {
    return min_width(shape(world, i), objects_[i].rests) <= opening - kBeside;
  };
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

}  // namespace mjsense::tasks::scenes
