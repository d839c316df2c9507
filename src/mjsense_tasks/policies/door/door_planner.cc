// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/door/door_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense_tasks/policies/navigation/nav_planner.h"
#include "mjsense_tasks/scenes/robot_floor.h"
#include "mjsense_tasks/tasks/door_opening/door_opening.h"

namespace mjsense::tasks::policies {
namespace {

constexpr episode::Phase kDoorPhases[] = {{"NAVIGATE_TO_DOOR", DoorPlanner::kNavigate},
                                          {"REACH_PRE_GRASP", DoorPlanner::kPregrasp},
                                          {"REACH_GRASP", DoorPlanner::kReach},
                                          {"GRASP_HANDLE", DoorPlanner::kGrasp},
                                          {"OPEN_DOOR", DoorPlanner::kOpen},
                                          {"RELEASE_HANDLE", DoorPlanner::kRelease},
                                          {"COMPLETE", DoorPlanner::kComplete},
                                          {"RECOVERY", DoorPlanner::kRecovery}};
constexpr double kThere = 0.06, kThereYaw = 0.1;  // m and rad, from the desired base pose
constexpr int kPlaces = 2;                        // further base poses tried before a retry
constexpr std::size_t kReachParts = 16;           // waypoints on the path to the pregrasp
constexpr std::size_t kParts = 5;  // segments of the opening; progress is checked at each

}  // namespace

std::span<const episode::Phase> DoorPlanner::phases() const { return kDoorPhases; }

void DoorPlanner::initialize_planner() {
  door_ = dynamic_cast<const tasks::DoorOpeningTask*>(&task());
  if (!door_)
    throw ValueError(
        fmt::format("the door planner opens doors; it cannot do task '{}'", task().name()));
  group_ = scenes::driving_base(robot());
  if (group_ < 0 || !door_->routes())
    throw ValueError(
        fmt::format("the door planner needs a mobile base; robot '{}' has none "
                    "(see `mjsense robots`)",
                    robot().name()));
  motions_ = std::make_unique<DoorMotions>(task().model(), robot(),
                                           DoorFloor{&door_->open_floor(), &door_->trunk()});
  if (motions_->hands().empty())
    throw ValueError(fmt::format(
        "the door planner needs an arm with a gripper; robot '{}' has none", robot().name()));
  expected_.assign(task().num_worlds(), {});
  tool_.assign(task().num_worlds(), -1);
  goal_.assign(task().num_worlds(), cfg_.open);
  margin_.assign(task().num_worlds(), cfg_.margin);
}

double DoorPlanner::remaining_leaf_angle(const World& world, double goal) const {
  const scenes::Door& door = door_->door(world.id);
  return door.shut + goal * (door.open - door.shut) -
         world.data->qpos[world.model->jnt_qposadr[door.joint]];
}

void DoorPlanner::make_plan(const World& world, const PlanRequest& request, Plan& plan) {
  expected_[world.id].clear();
  if (request.attempt == 0 && request.stage == 0) goal_[world.id] = cfg_.open;
  if (door_->fraction(world) >= goal_[world.id] - 0.02) {
    plan.wait(kComplete, 0.3);
    return;
  }
  if (request.attempt > 0 && request.stage == 0) return recover(world, plan);
  const int first = request.attempt > 0 ? 1 : 0;  // stage that drives to the door
  if (request.stage > first) {
    const std::optional<DoorMotion> motion = motions_->plan(
        world, door_->door(world.id), base_pose(world),
        remaining_leaf_angle(world, goal_[world.id]), margin_[world.id], tool_[world.id]);
    if (motion) return open_door(world, *motion, plan);
    // The base has missed the planned pose, and no plan works from here: try another pose.
    if (request.stage > first + kPlaces) {
      plan.rejection =
          "no collision-free motion of an arm opens the door from the current base pose";
      return;
    }
  }
  if (!approach(world, cfg_.open, cfg_.margin, plan) &&
      !approach(world, cfg_.enough, cfg_.margin, plan) &&
      !approach(world, cfg_.enough, cfg_.tight, plan)) {
    plan.clear();
    plan.rejection = "no reachable base pose allows a collision-free opening of the door";
  }
}

// Releases the handle, drives back, and returns the arms to their start positions.
void DoorPlanner::recover(const World& world, Plan& plan) const {
  plan.more = true;
  const scenes::BasePose here = base_pose(world);
  const DoorGeometry geometry(world.model, world.data, door_->door(world.id),
                              robot().base_pose(world).p);
  Segment& open = plan.wait(kRecovery, 0.5);
  std::vector<CommandPath> paths;
  for (const robots::Hand& hand : motions_->hands()) {
    open.grip(hand.gripper, robot().groups()[hand.gripper].open_command);
    const auto& init = robot().cfg().groups[hand.tool].init;
    if (init.size() == robot().groups()[hand.tool].qpos.size())
      paths.push_back(arm_path(world, hand.tool, init, 2.5));
  }
  for (const double back : {0.25, 0.12}) {
    const scenes::BasePose off{here.x + back * geometry.away.x, here.y + back * geometry.away.y,
                               here.yaw};
    if (motions_->clearance(geometry, off, 0) < 0) continue;
    const scenes::BasePose path[] = {here, off};
    plan.move_groups(kRecovery, {base_path(group_, path, cfg_.speeds)});
    break;
  }
  plan.move_groups(kRecovery, std::move(paths), 0.2);
}

// Plans the drive to the first base pose from which the door can be opened.
bool DoorPlanner::approach(const World& world, double goal, double margin, Plan& plan) {
  const scenes::BasePose here = base_pose(world);
  const scenes::Door& door = door_->door(world.id);
  int tried = 0;
  for (const scenes::BasePose& place : motions_->places(world, door)) {
    if (tried++ >= cfg_.max_places) break;
    const std::optional<DoorMotion> motion =
        motions_->plan(world, door, place, remaining_leaf_angle(world, goal), margin);
    if (!motion) continue;
    std::vector<scenes::BasePose> path;
    if (std::hypot(place.x - here.x, place.y - here.y) > kThere ||
        std::abs(scenes::wrapped(place.yaw - here.yaw)) > kThereYaw) {
      path = door_->routes()->find(here, place);
      // The start or the goal is outside the free floor (in the doorway, next to the open leaf):
      // drive straight.
      if (path.empty() && std::hypot(place.x - here.x, place.y - here.y) < 0.8)
        path = {here, place};
      if (path.empty()) continue;
    }
    if (path.empty()) {
      plan.wait(kNavigate, 0.1);
    } else {
      plan.move_groups(kNavigate, {base_path(group_, path, cfg_.speeds)}, 0.4);
    }
    plan.more = true;
    goal_[world.id] = goal;
    margin_[world.id] = margin;
    tool_[world.id] = motion->hand.tool;
    for (const robots::Hand& hand : motions_->hands()) {
      plan.segments.back().grip(hand.gripper, robot().groups()[hand.gripper].open_command);
      if (hand.tool != motion->hand.tool) tuck(world, hand, plan.segments.back());
    }
    return true;
  }
  return false;
}

void DoorPlanner::tuck(const World& world, const robots::Hand& hand, Segment& segment) const {
  segment.paths.push_back(arm_path(world, hand.tool, motions_->tucked(hand), 2.0));
  segment.duration = std::max(segment.duration, 2.2);
}

// A straight path in joint space from the measured positions.
CommandPath DoorPlanner::arm_path(const World& world, int arm, std::span<const double> to,
                                  double seconds) const {
  CommandPath path{.group = arm, .times = {0, seconds}, .points = measured(world, arm)};
  path.points.insert(path.points.end(), to.begin(), to.end());
  return path;
}

std::vector<double> DoorPlanner::measured(const World& world, int arm) const {
  std::vector<double> q;
  for (int address : robot().groups()[arm].qpos) q.push_back(world.data->qpos[address]);
  return q;
}

// Duration (s) of the motion to each waypoint from the previous one.
std::vector<double> DoorPlanner::seconds(std::span<const DoorWaypoint> waypoints,
                                         std::span<const double> from, const scenes::BasePose& at,
                                         double joint_speed) const {
  std::vector<double> out;
  for (std::size_t k = 0; k < waypoints.size(); ++k) {
    const scenes::BasePose& before = k == 0 ? at : waypoints[k - 1].base;
    const scenes::BasePose& base = waypoints[k].base;
    double t = std::max({0.05, std::hypot(base.x - before.x, base.y - before.y) / cfg_.base_speed,
                         std::abs(scenes::wrapped(base.yaw - before.yaw)) / cfg_.base_turn});
    if (k > 0)
      t = std::max(t, std::abs(waypoints[k].leaf - waypoints[k - 1].leaf) / cfg_.leaf_speed);
    for (std::size_t i = 0; i < waypoints[k].q.size(); ++i) {
      const double last = k == 0 ? from[i] : waypoints[k - 1].q[i];
      t = std::max(t, std::abs(waypoints[k].q[i] - last) / joint_speed);
    }
    out.push_back(t);
  }
  return out;
}

// Adds a segment that follows the waypoints.
void DoorPlanner::add_path(Plan& plan, int phase, const DoorMotion& motion,
                           std::span<const DoorWaypoint> waypoints, std::span<const double> seconds,
                           std::vector<double>& from, scenes::BasePose& at) const {
  CommandPath arm, base;
  arm.group = motion.hand.tool;
  base.group = group_;
  double time = 0;
  const auto add = [&] {
    arm.times.push_back(time);
    arm.points.insert(arm.points.end(), from.begin(), from.end());
    base.times.push_back(time);
    base.points.insert(base.points.end(), {at.x, at.y, at.yaw});
  };
  add();
  for (std::size_t k = 0; k < waypoints.size(); ++k) {
    const DoorWaypoint& next = waypoints[k];
    from = next.q;
    at = {next.base.x, next.base.y, at.yaw + scenes::wrapped(next.base.yaw - at.yaw)};
    time += seconds[k];
    add();
  }
  plan.move_groups(phase, {std::move(arm), std::move(base)});
}

void DoorPlanner::open_door(const World& world, const DoorMotion& motion, Plan& plan) {
  const robots::MoveGroup& gripper = robot().groups()[motion.hand.gripper];
  plan.grasp = motion.grasp;
  std::vector<double> q = measured(world, motion.hand.tool);
  scenes::BasePose at = base_pose(world);
  const auto add = [&](int phase, std::span<const DoorWaypoint> waypoints,
                       double speed) -> Segment& {
    std::vector<double> times = seconds(waypoints, q, at, speed);
    ease(times);
    add_path(plan, phase, motion, waypoints, times, q, at);
    return plan.segments.back();
  };
  const std::span<const DoorWaypoint> approach(motion.approach);
  std::vector<DoorWaypoint> reach(kReachParts, approach[0]);
  for (std::size_t k = 0; k < kReachParts; ++k) {
    const double part = static_cast<double>(k + 1) / kReachParts;
    for (std::size_t i = 0; i < q.size(); ++i)
      reach[k].q[i] = std::lerp(q[i], approach[0].q[i], part);
  }
  add(kPregrasp, reach, cfg_.reach_speed).grip(motion.hand.gripper, gripper.open_command);
  add(kReach, approach.subspan(1), cfg_.slow_speed);
  plan.wait(kReach, 0.3);
  plan.wait(kGrasp, cfg_.close_time).grip(motion.hand.gripper, gripper.closed_command);
  if (!motion.press.empty()) {
    add(kOpen, motion.press, cfg_.press_speed).holds(motion.hand.gripper);
    plan.wait(kOpen, 0.2).holds(motion.hand.gripper);
  }
  const std::span<const DoorWaypoint> open(motion.open);
  std::vector<double> times = seconds(open, q, at, cfg_.joint_speed);
  ease(times);
  const double begin = door_->fraction(world);
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::size_t first = open.size() * part / kParts, last = open.size() * (part + 1) / kParts;
    if (last == first) continue;
    add_path(plan, kOpen, motion, open.subspan(first, last - first),
             std::span(times).subspan(first, last - first), q, at);
    const double done = static_cast<double>(last) / static_cast<double>(open.size());
    expected_[world.id].push_back(
        {static_cast<int>(plan.segments.size()), begin + done * (goal_[world.id] - begin)});
  }
  plan.wait(kOpen, 0.3);
  // Open only halfway: fully open fingers would hit the leaf.
  plan.wait(kRelease, 0.4)
      .grip(motion.hand.gripper, std::midpoint(gripper.closed_command, gripper.open_command));
  // After a push the hand stays at the leaf: the door closer would shut the door again.
  if (!motion.leave.empty() && !door_->push(world.id))
    add(kRelease, motion.leave, cfg_.press_speed);
  plan.wait(kComplete, 0.3);
}

bool DoorPlanner::gone_wrong(const World& world) const {
  const int segment = follower().segment(world.id);
  double wanted = 0;
  for (const Expected& one : expected_[world.id]) {
    if (segment >= one.segment) wanted = one.fraction;
  }
  // Once the door is open, a lag no longer matters.
  const double fraction = door_->fraction(world);
  return fraction < tasks::DoorOpeningTask::kOpen + 0.02 && fraction < wanted - cfg_.lag;
}

}  // namespace mjsense::tasks::policies
