// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/follower.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"

namespace mjsense {
namespace {

constexpr double kFade = 1.0;       // s, at least
constexpr double kFadeSpeed = 0.5;  // rad/s or m/s, on average, of what fades faster otherwise

int floating_base(const Robot& robot) {
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const MoveGroup& group = robot.groups()[g];
    if (group.kind == GroupKind::kBase && group.command_size == 7) return static_cast<int>(g);
  }
  return -1;
}

}  // namespace

std::vector<Hand> hands_of(const Robot& robot, const mjModel* model) {
  const auto groups = robot.groups();
  std::vector<Hand> hands;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const MoveGroup& gripper = groups[g];
    if (gripper.kind != GroupKind::kGripper || gripper.leaf_site < 0) continue;
    int arm = -1;
    for (std::size_t a = 0; a < groups.size() && arm < 0; ++a) {
      if (groups[a].kind == GroupKind::kArm && groups[a].leaf_site == gripper.leaf_site)
        arm = static_cast<int>(a);
    }
    for (std::size_t a = 0; a < groups.size() && arm < 0; ++a) {
      if (groups[a].kind == GroupKind::kArm && groups[a].leaf_site >= 0 &&
          is_below(model, gripper.root_body, groups[a].root_body))
        arm = static_cast<int>(a);
    }
    if (arm < 0 && floating_base(robot) >= 0) arm = static_cast<int>(g);
    if (arm >= 0) hands.push_back({static_cast<int>(g), arm});
  }
  return hands;
}

void Follower::initialize(const Robot& robot, const mjModel* model, int num_worlds) {
  robot_ = &robot;
  floating_base_ = floating_base(robot);
  for (const Hand& hand : hands_of(robot, model)) {
    if (hand.tool == hand.gripper || joints_are_commanded(hand.tool)) continue;
    throw ValueError(fmt::format(
        "policy 'planner' commands joint positions; the controller of move group '{}' of robot "
        "'{}' takes other commands",
        robot.groups()[hand.tool].name, robot.name()));
  }
  states_.assign(num_worlds, {});
}

bool Follower::joints_are_commanded(int group) const {
  const MoveGroup& g = robot_->groups()[group];
  return g.targets_are_qpos() && g.command_size == g.target_size;
}

void Follower::restart(const World& world) {
  State& state = states_[world.id];
  state.commands = {};
  robot_->read_qpos(world, state.joints);
  for (Target& target : state.targets) target.given = false;
}

void Follower::begin(const World& world) {
  State& state = states_[world.id];
  state.segment = 0;
  state.start = world.time();
  state.finished = false;
  state.ik_failures = 0;
  if (!state.plan.segments.empty()) enter(state, state.plan.segments[0]);
}

PlanFailure Follower::failure(const World& world) const {
  const State& state = states_[world.id];
  for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
    const Target& target = state.targets[g];
    if (!target.given) continue;
    const Pose tool = target.in_world ? robot_->leaf_pose(world, static_cast<int>(g))
                                      : robot_->tcp_pose(world, static_cast<int>(g));
    if (norm(tool.p - target.pose.p) > cfg_.max_position_error) return PlanFailure::kToolAway;
    if (angle_between(tool.q, target.pose.q) > cfg_.max_rotation_error)
      return PlanFailure::kToolTurned;
  }
  const auto n = static_cast<int>(state.plan.segments.size());
  if (n > 0) {
    for (int gripper : state.plan.segments[std::min(state.segment, n - 1)].holding) {
      if (robot_->opening(world, gripper) < cfg_.min_held_opening) return PlanFailure::kDropped;
    }
  }
  return state.ik_failures >= cfg_.max_ik_failures ? PlanFailure::kUnreachable : PlanFailure::kNone;
}

// What nobody commands is where it is: a torso under an arm.
void Follower::read_free_joints(const World& world, State& state) const {
  for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
    if (state.commands[g].given && joints_are_commanded(static_cast<int>(g))) continue;
    const auto& address = robot_->groups()[g].qpos;
    if (robot_->groups()[g].kind == GroupKind::kArm) continue;
    for (std::size_t i = 0; i < address.size(); ++i)
      state.joints[g].values[i] = world.data->qpos[address[i]];
  }
}

bool Follower::move_tool(const World& world, State& state, const ToolMove& move, double time) {
  const double s = move.seconds == 0 ? 1.0 : std::min(1.0, time / move.seconds);
  const Pose pose = move.from * exp6((move.eased ? s * s * (3 - 2 * s) : s) * move.screw);
  state.targets[move.tool] = {true, move.in_world, pose};
  if (robot_->groups()[move.tool].kind == GroupKind::kGripper) {  // the base carries it
    const Pose to = move.in_world ? pose : robot_->base_pose(world) * pose;
    const Pose base = to * inverse(robot_->tcp_pose(world, move.tool));
    double command[7];
    write_pose(base, command);
    state.commands[floating_base_].set(command);
    return true;
  }
  const Pose target = move.in_world ? inverse(robot_->base_pose(world)) * pose : pose;
  const bool solved = robot_->ik(move.tool, target, state.joints, Chain::kTracking);
  // Where it is not, the last command stands.
  state.commands[move.tool].set(
      {state.joints[move.tool].values.data(), robot_->groups()[move.tool].qpos.size()});
  return solved;
}

void Follower::move_group(State& state, const CommandPath& path, double time) {
  const std::size_t n = robot_->groups()[path.group].command_size;
  const auto next = std::ranges::upper_bound(path.times, time);
  const std::size_t b = next - path.times.begin();
  GroupValues& command = state.commands[path.group];
  if (b == 0 || b == path.times.size()) {
    command.set(std::span(path.points).subspan(b == 0 ? 0 : (b - 1) * n, n));
  } else {
    const double s = (time - path.times[b - 1]) / (path.times[b] - path.times[b - 1]);
    std::array<double, GroupValues::kMaxSize> values;
    for (std::size_t i = 0; i < n; ++i) {
      const double from = path.points[(b - 1) * n + i], to = path.points[b * n + i];
      values[i] = from + s * (to - from);
    }
    command.set({values.data(), n});
  }
  if (!joints_are_commanded(path.group)) return;
  double most = 0;
  for (std::size_t i = 0; i < n; ++i)
    most = std::max(most, std::abs(state.offsets[path.group].values[i]));
  const double fade = std::min(path.times.back(), std::max(kFade, most / kFadeSpeed));
  if (state.offsets[path.group].given && time < fade) {
    const double s = time / fade, left = 1 - s * s * (3 - 2 * s);
    for (std::size_t i = 0; i < n; ++i)
      command.values[i] += left * state.offsets[path.group].values[i];
  }
  std::copy_n(command.values.begin(), n, state.joints[path.group].values.begin());
}

// Inverse kinematics along a line ends near, not at, the joints from which a path was planned: an arm with more joints than it
// needs drifts. What is left fades away along the path.
void Follower::enter(State& state, const Segment& segment) const {
  for (const CommandPath& path : segment.paths) {
    GroupValues& offset = state.offsets[path.group];
    offset.given = state.commands[path.group].given && joints_are_commanded(path.group);
    if (!offset.given) continue;
    const std::size_t n = robot_->groups()[path.group].command_size;
    for (std::size_t i = 0; i < n; ++i) {
      offset.values[i] = state.joints[path.group].values[i] - path.points[i];
    }
  }
}

// A segment ends between two steps, or takes no time at all: what it was to reach is commanded,
// unless the next segment takes over.
void Follower::finish(const World& world, State& state, const Segment& done, const Segment& next) {
  for (const GripperCommand& grip : done.grippers)
    state.commands[grip.gripper].set({&grip.command, 1});
  for (const CommandPath& path : done.paths) move_group(state, path, done.duration);
  for (const ToolMove& move : done.tools) {
    const auto taken = [&](const ToolMove& other) { return other.tool == move.tool; };
    if (std::ranges::none_of(next.tools, taken)) move_tool(world, state, move, done.duration);
  }
}

Pose Follower::tool_target(const World& world, int tool) const {
  const State& state = states_[world.id];
  if (robot_->groups()[tool].kind != GroupKind::kArm) {
    const Target& target = state.targets[tool];
    if (!target.given) return robot_->tcp_pose(world, tool);
    return target.in_world ? inverse(robot_->base_pose(world)) * target.pose : target.pose;
  }
  if (!state.commands[tool].given) return robot_->tcp_pose(world, tool);
  return robot_->fk(tool, state.joints);
}

void Follower::follow(const World& world, Action& action) {
  State& state = states_[world.id];
  const auto& segments = state.plan.segments;
  const auto n = static_cast<int>(segments.size());
  while (state.segment < n && world.time() - state.start >= segments[state.segment].duration) {
    state.start += segments[state.segment].duration;
    ++state.segment;
    if (state.segment == n) break;
    finish(world, state, segments[state.segment - 1], segments[state.segment]);
    enter(state, segments[state.segment]);
  }
  state.finished = state.segment == n;
  if (n > 0) {
    const Segment& segment = segments[std::min(state.segment, n - 1)];
    state.phase = segment.phase;
    const double time =
        state.finished ? segment.duration : std::max(0.0, world.time() - state.start);
    for (const GripperCommand& grip : segment.grippers)
      state.commands[grip.gripper].set({&grip.command, 1});
    read_free_joints(world, state);
    for (const CommandPath& path : segment.paths) move_group(state, path, time);
    // Arms that no tool move draws: where their joints put the tool, whatever carries them.
    for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
      const bool arm = robot_->groups()[g].kind == GroupKind::kArm && state.commands[g].given;
      if (arm &&
          std::ranges::none_of(segment.tools, [&](const ToolMove& m) { return m.tool == int(g); }))
        state.targets[g] = {true, false, robot_->fk(static_cast<int>(g), state.joints)};
    }
    bool solved = true;
    for (const ToolMove& move : segment.tools)
      solved = move_tool(world, state, move, time) && solved;
    state.ik_failures = solved ? 0 : state.ik_failures + 1;
  }
  for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
    const MoveGroup& group = robot_->groups()[g];
    const GroupValues& command = state.commands[g];
    if (command.given) {
      action.commands[g].set(command.view());
    } else if (group.kind == GroupKind::kBase && !group.controlled()) {
      action.commands[g].set({});  // one that drives is left out: it holds
    }
  }
}

}  // namespace mjsense
