// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/base_placement_search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <span>
#include <vector>

#include "mjsense/core/model_geometry.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/observe/touches.h"
#include "mjsense_tasks/robots/hands.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr int kGrid = 3;                     // points along each side of a target area
constexpr double kHeights[] = {0.06, 0.15};  // m, tool height above the target area
constexpr double kTilts[] = {0, 45};         // degrees from vertical
constexpr double kAnyTilts[] = {0, 45, 90};  // for the test whether a region is reachable at all
constexpr double kStep = 0.05;               // m, between two base positions
constexpr int kBack = 4, kAhead = 8;         // steps
constexpr double kEnough = 0.95;             // fraction of the points
constexpr double kHang = 0.35;      // m, height of a floating hand's tool above the targets
constexpr double kHangBack = 0.15;  // m, towards the scene's base pose
constexpr int kIterations = 250;
constexpr double kDeep = 0.001;  // m
constexpr double kRoom = 0.01;   // m, minimum distance from obstacles of a base that is moved

// Points (m, world frame) that tools must reach, and the centre of the target areas on the surface.
std::vector<Vec3> targets(const mjModel* m, const EpisodeScene& scene) {
  std::vector<Vec3> points;
  for (const Region& region : scene.regions()) {
    const Area& a = region.target_area;
    for (int i = 0; i < kGrid; ++i) {
      for (int k = 0; k < kGrid; ++k) {
        points.push_back({a.x0 + (a.x1 - a.x0) * i / (kGrid - 1),
                          a.y0 + (a.y1 - a.y0) * k / (kGrid - 1), region.height});
      }
    }
  }
  if (!points.empty()) return points;
  for (const SceneObject& object : scene.objects())
    points.push_back(vec3(m->qpos0 + free_qpos(m, object.body)));
  return points;
}

robots::RobotValues start_of(const mjModel* model, const robots::Robot& robot,
                             bool stooped = false) {
  robots::RobotValues start;
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const robots::MoveGroup& group = robot.groups()[g];
    const robots::MoveGroupCfg& cfg = robot.cfg().groups[g];
    const auto& init = stooped && !cfg.low_init.empty() ? cfg.low_init : cfg.init;
    start[g].size = static_cast<int>(group.qpos.size());
    for (std::size_t i = 0; i < group.qpos.size(); ++i)
      start[g].values[i] = i < init.size() ? init[i] : model->qpos0[group.qpos[i]];
  }
  return start;
}

// Fraction of the approach orientations at a point that a hand can reach; maximum over the hands.
double reachable_orientations(const robots::Robot& robot, const robots::RobotValues& start,
                              const Pose& base, Vec3 point, std::span<const double> tilts) {
  double best = 0;
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    if (robot.groups()[g].kind != robots::GroupKind::kArm || robot.groups()[g].leaf_site < 0)
      continue;
    int reached = 0, orientations = 0;
    for (double tilt : tilts) {
      for (int quarter = 0; quarter < 2; ++quarter, ++orientations) {
        // Pointing down, tilted outwards by `tilt`, with the fingers in one of two perpendicular
        // directions.
        const Quat q =
            axis_angle({0, 1, 0}, pi - tilt * pi / 180) * axis_angle({0, 0, 1}, 0.5 * pi * quarter);
        robots::RobotValues values = start;
        const Pose tool{point, base.q * q};
        reached += robot.ik(static_cast<int>(g), inverse(base) * tool, values, kIterations);
      }
    }
    best = std::max(best, static_cast<double>(reached) / orientations);
  }
  return best;
}

// Fractions (0 to 1) of the points, and of the approach orientations at all points, that are
// reachable.
struct Reached {
  double points = 0, orientations = 0;
  std::vector<char> point;  // whether there is a way to it
};

// Evaluates base positions, with the robot upright or stooped.
class Search {
 public:
  Search(const mjModel* model, const robots::Robot& robot, const EpisodeScene& scene,
         std::span<const Vec3> surface, bool stooped)
      : model_(model), robot_(robot), scene_(scene), data_(make_data(model)) {
    start_ = start_of(model, robot, stooped);
    for (Vec3 p : surface) {
      for (double height : kHeights) points_.push_back(p + Vec3{0, 0, height});
    }
  }

  Reached reached(const Pose& base, std::span<const double> tilts = kTilts) const {
    Reached out;
    for (Vec3 p : points_) {
      const double orientations = reachable_orientations(robot_, start_, base, p, tilts);
      out.points += orientations > 0;
      out.orientations += orientations;
      out.point.push_back(orientations > 0);
    }
    out.points /= static_cast<double>(points_.size());
    out.orientations /= static_cast<double>(points_.size());
    return out;
  }

  // Whether the base is collision-free at all poses that the scene may sample, with a margin.
  bool is_free(const Pose& base, const Pose& offset) const {
    if (!is_collision_free(base * offset)) return false;
    const SceneRobotCfg& cfg = scene_.cfg().robot;
    for (int corner = 0; corner < 8; ++corner) {
      const double x = (cfg.pos_spread[0] + kRoom) * (corner & 1 ? 1 : -1);
      const double y = (cfg.pos_spread[1] + kRoom) * (corner & 2 ? 1 : -1);
      const double yaw = cfg.yaw_spread * (corner & 4 ? 1 : -1);
      const Pose there{base.p + Vec3{x, y, 0}, axis_angle({0, 0, 1}, yaw * pi / 180) * base.q};
      if (!is_collision_free(there * offset)) return false;
    }
    return true;
  }

  // Finds the forward or backward offset with more reachable approach orientations than `best`; of
  // equal ones, the smallest offset.
  void improve(const Pose& base, double& best, Pose& offset) const {
    for (int k = -kBack; k <= kAhead; ++k) {
      const Pose moved{{kStep * k, 0, 0}, {}};
      if (k == 0 || !is_free(base, moved)) continue;
      const double orientations = reached(base * moved).orientations;
      if (orientations < best ||
          (orientations == best && std::abs(moved.p.x) >= std::abs(offset.p.x)))
        continue;
      best = orientations;
      offset = moved;
    }
  }

 private:
  bool is_collision_free(const Pose& base) const {
    mj_resetData(model_, data_.get());
    Rng none(0, 0, 0, 0);
    robot_.write_start(robots::state_row(data_.get()), base, none);
    for (std::size_t g = 0; g < robot_.groups().size(); ++g) {
      const auto& address = robot_.groups()[g].qpos;
      if (robot_.cfg().groups[g].init.empty()) continue;
      for (std::size_t i = 0; i < address.size(); ++i)
        data_->qpos[address[i]] = start_[g].values[i];
    }
    // objects are placed later, at a distance from the robot
    for (const SceneObject& object : scene_.objects())
      data_->qpos[free_qpos(model_, object.body)] += 100;
    mj_kinematics(model_, data_.get());
    mj_comPos(model_, data_.get());
    mj_collision(model_, data_.get());
    const int root = model_->body_rootid[robot_.base_body()];
    bool collides = false;
    observe::each_touch(model_, data_.get(), root, [&](const observe::Touch& touch) {
      collides = collides || touch.contact->dist <= -kDeep;
    });
    return !collides && !stands_in_something(root);
  }

  // MuJoCo generates no contacts between static geoms, such as a robot's base and furniture.
  bool stands_in_something(int root) const {
    const auto stands = [&](int g) {
      return model_->body_treeid[model_->geom_bodyid[g]] < 0 && is_solid(model_, g);
    };
    for (int a = 0; a < model_->ngeom; ++a) {
      if (!stands(a) || model_->body_rootid[model_->geom_bodyid[a]] != root) continue;
      for (int b = 0; b < model_->ngeom; ++b) {
        const int type = model_->geom_type[b];
        if (!stands(b) || model_->body_rootid[model_->geom_bodyid[b]] == root ||
            type == mjGEOM_PLANE || type == mjGEOM_HFIELD || type == mjGEOM_SDF)
          continue;
        if (mj_geomDistance(model_, data_.get(), a, b, kDeep, nullptr) < -kDeep) return true;
      }
    }
    return false;
  }

  const mjModel* model_;
  const robots::Robot& robot_;
  const EpisodeScene& scene_;
  DataPtr data_;
  robots::RobotValues start_;
  std::vector<Vec3> points_;  // m, world
};

// The points of a region follow each other.
void limit_targets(const Reached& reached, EpisodeScene& scene) {
  const std::size_t regions = scene.regions().size();
  if (regions < 2) return;
  const std::size_t points = reached.point.size() / regions;
  std::vector<char> flags;
  for (std::size_t i = 0; i < regions; ++i) {
    const auto of_region = std::span(reached.point).subspan(i * points, points);
    flags.push_back(2 * std::ranges::count(of_region, 1) >= static_cast<long>(points));
  }
  if (std::ranges::count(flags, 1) > 0) scene.set_target_regions(flags);
}

}  // namespace

BasePlacementSearch::BasePlacementSearch(const mjModel* model, robots::Robot& robot,
                                         EpisodeScene& scene) {
  const std::vector<Vec3> surface = targets(model, scene);
  if (surface.empty()) return;
  const SceneRobotCfg& cfg = scene.cfg().robot;
  const Pose base{{cfg.pos[0], cfg.pos[1], cfg.pos[2]}, axis_angle({0, 0, 1}, cfg.yaw * pi / 180)};
  const bool has_arm = std::ranges::any_of(robot.groups(), [](const robots::MoveGroup& group) {
    return group.kind == robots::GroupKind::kArm && group.leaf_site >= 0;
  });
  if (!has_arm) {
    if (robots::floating_base(robot) < 0 || robot.gripper() < 0) return;
    Vec3 middle;
    double top = surface[0].z;
    for (Vec3 p : surface) {
      middle = middle + (1.0 / static_cast<double>(surface.size())) * p;
      top = std::max(top, p.z);
    }
    const double reach = robot.fk(robot.gripper(), start_of(model, robot)).p.z;
    const Vec3 back = rotate(base.q, {-kHangBack, 0, 0});
    const Pose hang{{middle.x + back.x, middle.y + back.y, top + kHang + reach},
                    base.q * Quat{0, 1, 0, 0}};
    offset_ = inverse(base) * hang;
    return;
  }

  const Search upright(model, robot, scene, surface, false);
  const Reached there = upright.reached(base);
  if (there.points >= kEnough) return;
  double best = there.orientations;
  upright.improve(base, best, offset_);
  if (upright.reached(base * offset_).points >= kEnough) return;
  const auto stoops = [](const robots::MoveGroupCfg& group) { return !group.low_init.empty(); };
  if (std::ranges::any_of(robot.cfg().groups, stoops)) {
    const Search stooped(model, robot, scene, surface, true);
    Pose offset;
    double lower = stooped.is_free(base, {}) ? stooped.reached(base).orientations : 0;
    stooped.improve(base, lower, offset);
    if (lower > best) {
      offset_ = offset;
      robot.lower_torso();
      limit_targets(stooped.reached(base * offset_, kAnyTilts), scene);
      return;
    }
  }
  limit_targets(upright.reached(base * offset_, kAnyTilts), scene);
}

}  // namespace mjsense::tasks::scenes
