// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/base_reposition.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"
#include "mjsense_tasks/policies/navigation/nav_planner.h"

namespace mjsense::tasks::policies {
namespace {

constexpr double kStep = 0.12;               // m, grid of base poses
constexpr int kSteps = 4;                    // in each direction
constexpr double kTurns[] = {0, 0.4, -0.4};  // rad
constexpr double kTurnCost = 0.3;            // m/rad
constexpr int kMaxTried = 16;                // reachable base poses for which works() is called
constexpr double kMargin = 0.015;            // m, clearance along the path
constexpr double kFloor = 0.05;              // m; the base drives over what is lower
constexpr double kSettle = 0.3;              // s
constexpr scenes::BaseSpeeds kSpeeds{0.25, 0.5, 0.25, 0.5};

struct Shift {
  double x, y, turn;  // in the base's frame
  double cost() const { return std::hypot(x, y) + kTurnCost * std::abs(turn); }
};

std::vector<Shift> nearest_first() {
  std::vector<Shift> shifts;
  for (int i = -kSteps; i <= kSteps; ++i) {
    for (int k = -kSteps; k <= kSteps; ++k) {
      for (double turn : kTurns) {
        if (i != 0 || k != 0 || turn != 0) shifts.push_back({kStep * i, kStep * k, turn});
      }
    }
  }
  std::ranges::stable_sort(shifts, {}, &Shift::cost);
  return shifts;
}

}  // namespace

BaseReposition::BaseReposition(const mjModel* model, const robots::Robot& robot)
    : model_(model),
      robot_(robot),
      group_(scenes::driving_base(robot)),
      collisions_(model, robot, robot.groups()[group_].joints),
      scratch_(model) {}

bool BaseReposition::plan(const World& world, int phase, const std::optional<Held>& held,
                          const std::function<bool(const World&)>& works, Plan& plan) {
  const Pose base = robot_.base_pose(world);
  const auto& address = robot_.groups()[group_].qpos;
  const std::array<double, 3> from{world.data->qpos[address[0]], world.data->qpos[address[1]],
                                   world.data->qpos[address[2]]};
  CollisionQuery query(collisions_, world);
  query.ignore_below(base.p.z + kFloor);
  if (held) query.hold(held->hand.tool, held->hand.gripper, held->body, held->tool_object);
  query.set_margin(kMargin);
  if (!query.free(from)) query.set_margin(0);
  const worlds::ScratchData::Loan scratch = scratch_.borrow();
  World there = world;
  there.data = scratch.get();
  scratch->time = world.data->time;
  worlds::copy_positions(model_, world.data, scratch.get());
  int tried = 0;
  for (const Shift& shift : nearest_first()) {
    const double c = std::cos(from[2]), s = std::sin(from[2]);
    const std::array<double, 3> to{from[0] + c * shift.x - s * shift.y,
                                   from[1] + s * shift.x + c * shift.y, from[2] + shift.turn};
    if (!query.free(to) || !query.free_between(from, to)) continue;
    mju_copy(scratch->qpos, world.data->qpos, model_->nq);
    for (int i = 0; i < 3; ++i) scratch->qpos[address[i]] = to[i];
    mj_kinematics(world.model, scratch.get());
    if (held) {
      const Pose object = robot_.leaf_pose(there, held->hand.tool) * held->tool_object;
      write_pose(object, scratch->qpos + free_qpos(model_, held->body));
      mj_kinematics(world.model, scratch.get());
    }
    if (works(there)) {
      const scenes::BasePose path[] = {{from[0], from[1], from[2]}, {to[0], to[1], to[2]}};
      Segment& segment = plan.move_groups(phase, {base_path(group_, path, kSpeeds)}, kSettle);
      if (held) segment.holds(held->hand.gripper);
      return true;
    }
    if (++tried == kMaxTried) return false;
  }
  return false;
}

}  // namespace mjsense::tasks::policies
