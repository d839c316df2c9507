// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <optional>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

// A static box with horizontal top; any of its axes may be vertical.
struct LevelBox {
  int geom = -1;
  double x = 0, y = 0, top = 0;  // centre and height of its top
  double wide = 0, deep = 0;     // half sizes of the top along x and y
};

std::optional<LevelBox> level_box(const mjModel* m, int g) {
  if (m->geom_type[g] != mjGEOM_BOX) return {};
  Pose pose = geom_frame(m, g);
  for (int body = m->geom_bodyid[g]; body > 0; body = m->body_parentid[body]) {
    if (m->body_jntnum[body] > 0) return {};
    pose = body_frame(m, body) * pose;
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
      of_body ? highest_box(m, body) : level_box(m, scene::resolve(m, mjOBJ_GEOM, name, who));
  if (box) return *box;
  throw ValueError(of_body ? fmt::format("{}: body '{}' has no level, fixed box", who, name)
                           : fmt::format("{}: geom '{}' must be a level, fixed box", who, name));
}

// Throws ValueError unless all corners are on the surface `on`, or on a neighbour of the same height:
// an object would start in the air. A tabletop may consist of several boxes.
void check_on_surface(const mjModel* m, const LevelBox& on, const Area& area,
                      const std::string& who) {
  constexpr double kRounding = 1e-6, kSameHeight = 1e-3;  // m
  const auto is_on = [](const LevelBox& box, double x, double y) {
    return std::abs(x - box.x) <= box.wide + kRounding &&
           std::abs(y - box.y) <= box.deep + kRounding;
  };
  for (const double x : {area.x0, area.x1}) {
    for (const double y : {area.y0, area.y1}) {
      bool found = is_on(on, x, y);
      for (int g = 0; g < m->ngeom && !found; ++g) {
        const std::optional<LevelBox> box = level_box(m, g);
        found = box && std::abs(box->top - on.top) <= kSameHeight && is_on(*box, x, y);
      }
      if (found) continue;
      throw ValueError(
          fmt::format("{} is [{}, {}, {}, {}]: ({}, {}) is not on the surface, which has x from "
                      "{:.6g} to {:.6g} and y from {:.6g} to {:.6g}",
                      who, area.x0, area.x1, area.y0, area.y1, x, y, on.x - on.wide, on.x + on.wide,
                      on.y - on.deep, on.y + on.deep));
    }
  }
}

}  // namespace

void EpisodeScene::find_regions() {
  regions_.clear();
  region_bodies_.clear();
  for (const SceneRegionCfg& one : cfg_.regions) {
    const std::string who = fmt::format("{}, region '{}'", context(), one.name);
    const LevelBox on = surface_named(model_, one.on, who);
    const auto area = [](const std::array<double, 4>& a) { return Area{a[0], a[1], a[2], a[3]}; };
    Region region{};
    region.height = on.top;
    region.area = one.area == std::array<double, 4>{}
                      ? Area{on.x - on.wide, on.x + on.wide, on.y - on.deep, on.y + on.deep}
                      : area(one.area);
    region.target_area = one.target_area ? area(*one.target_area) : region.area;
    check_on_surface(model_, on, region.area, who + ": area");
    check_on_surface(model_, on, region.target_area, who + ": target_area");
    regions_.push_back(region);
    region_bodies_.push_back(model_->geom_bodyid[on.geom]);
  }
}

void EpisodeScene::set_target_regions(std::span<const char> flags) {
  for (std::size_t i = 0; i < regions_.size(); ++i) regions_[i].for_targets = flags[i] != 0;
}

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
      if (pattern.fullmatch(scene::name_of(model_, mjOBJ_BODY, body)))
        furniture_.insert_or_assign(body, one);
    }
  }
}

std::vector<Pose> EpisodeScene::elsewhere(int geom) const {
  std::vector<Pose> moves;
  for (int body = model_->geom_bodyid[geom]; body > 0; body = model_->body_parentid[body]) {
    const auto one = furniture_.find(body);
    if (one == furniture_.end()) continue;
    const Pose here = body_frame(model_, body);
    const Pose parent = in_ancestor(model_, {}, model_->body_parentid[body]);
    if (moves.empty()) moves.emplace_back();
    std::vector<Pose> all;
    for (const double turn : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
      if (turn != 0 && one->second.angle == 0) continue;
      for (Vec3 move : box_corners({}, vec3(one->second.pos.data()))) {
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

}  // namespace mjsense::tasks::scenes
