// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/navigation/nav_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense_tasks/scenes/robot_floor.h"
#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"

namespace mjsense::tasks::policies {
namespace {

constexpr episode::Phase kNavPhases[] = {{"navigate", 0}};
constexpr double kLook = 0.4;        // rad, turn to each side
constexpr double kElsewhere = 0.35;  // m, minimum distance from poses that were tried
constexpr int kLooks = 2;
constexpr double kSlack = 0.05;  // m, by which the base may miss a pose

}  // namespace

CommandPath base_path(int group, std::span<const scenes::BasePose> poses,
                      const scenes::BaseSpeeds& speeds) {
  CommandPath path;
  path.group = group;
  for (const scenes::TimedBasePose& one : scenes::timed(poses, speeds)) {
    path.times.push_back(one.time);
    path.points.insert(path.points.end(), {one.pose.x, one.pose.y, one.pose.yaw});
  }
  return path;
}

std::span<const episode::Phase> NavPlanner::phases() const { return kNavPhases; }

void NavPlanner::initialize_planner() {
  nav_ = dynamic_cast<const tasks::NavToObjTask*>(&task());
  if (!nav_)
    throw ValueError(fmt::format("the navigation planner drives to objects; it cannot do task '{}'",
                                 task().name()));
  if (!nav_->routes())
    throw ValueError(
        fmt::format("the navigation planner needs a mobile base; robot '{}' has none "
                    "(see `mjsense robots`)",
                    robot().name()));
  group_ = scenes::driving_base(robot());
  tried_.assign(task().num_worlds(), {});
  enough_.assign(task().num_worlds(), 0);
}

bool NavPlanner::is_goal_pose(const World& world, const scenes::BasePose& there,
                              const Pose& camera_in_base, double arrive, double facing) const {
  if (nav_->distance(world, there.x, there.y) > arrive) return false;
  const double* at = world.data->xpos + 3 * nav_->objects(world.id)[0].body;
  if (std::abs(scenes::wrapped(std::atan2(at[1] - there.y, at[0] - there.x) - there.yaw)) > facing)
    return false;
  for (const scenes::BasePose& tried : tried_[world.id]) {
    if (std::hypot(tried.x - there.x, tried.y - there.y) < kElsewhere) return false;
  }
  return nav_->sees(world, there.at_height(0) * camera_in_base);
}

void NavPlanner::make_plan(const World& world, const PlanRequest& request, Plan& plan) {
  auto& tried = tried_[world.id];
  if (request.stage == 0 && request.attempt == 0) {
    tried.clear();
    enough_[world.id] = cfg_.arrive + 0.2;
  }
  const scenes::BasePose here = base_pose(world);
  const Pose camera_in_base = inverse(robot().base_pose(world)) * nav_->camera_pose(world);
  if (nav_->distance(world, here.x, here.y) < enough_[world.id] &&
      nav_->sees(world, nav_->camera_pose(world))) {
    plan.wait(0, 0.2);  // arrived
    return;
  }
  plan.more = true;
  if (request.stage > 0 && request.stage % (kLooks + 1) != 0) {
    const scenes::BasePose aside{here.x, here.y,
                                 here.yaw + (request.stage % 2 == 1 ? kLook : -2 * kLook)};
    if (nav_->routes()->free_between(here, aside)) {
      const scenes::BasePose path[] = {here, aside};
      plan.move_groups(0, {base_path(group_, path, cfg_.speeds)}, 0.2);
      return;
    }
  }
  if (request.stage > 0) tried.push_back(here);
  std::vector<scenes::BasePose> path;
  // The last resort is any pose that counts as success: farther away, or with the object near the
  // image border.
  struct Wanted {
    double arrive, facing;
  };
  for (const Wanted& wanted : {Wanted{cfg_.arrive, cfg_.facing}, Wanted{cfg_.reach, cfg_.facing},
                               Wanted{tasks::NavToObjTask::kNearby, std::numbers::pi}}) {
    if (path.size() > 1) break;
    path = nav_->routes()->find(
        here,
        [&](const scenes::BasePose& p) {
          return is_goal_pose(world, p, camera_in_base, wanted.arrive, wanted.facing);
        },
        [&](double x, double y) {
          return std::max(0.0, nav_->distance(world, x, y) - wanted.arrive);
        });
    enough_[world.id] = std::max(enough_[world.id], wanted.arrive + kSlack);
  }
  if (path.size() < 2) {
    plan.more = false;
    plan.rejection = "no reachable base pose is left from which the camera sees the object";
    return;
  }
  plan.move_groups(0, {base_path(group_, path, cfg_.speeds)}, 0.4);
}

bool NavPlanner::gone_wrong(const World& world) const {
  const robots::GroupValues& target = robot().targets(world.id)[group_];
  if (!target.given || target.size < 2) return false;
  const scenes::BasePose here = base_pose(world);
  return std::hypot(target.values[0] - here.x, target.values[1] - here.y) > cfg_.astray;
}

}  // namespace mjsense::tasks::policies
