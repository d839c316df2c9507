// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/plan_follower.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"
#include "mjsense_tasks/scenes/base_planner.h"

namespace mjsense::tasks::policies {
namespace {

constexpr double kFade = 1.0;       // s, minimum duration of the fade of an offset
constexpr double kFadeSpeed = 0.5;  // rad/s or m/s, maximum average speed of that fade

}  // namespace

void Follower::initialize(const robots::Robot& robot, const mjModel* model, int num_worlds,
                          double dt) {
  robot_ = &robot;
  dt_ = dt;
  slides_.clear();
  for (const robots::MoveGroup& group : robot.groups()) {
    slides_.emplace_back();
    for (int joint : group.joints) slides_.back().push_back(model->jnt_type[joint] == mjJNT_SLIDE);
  }
  floating_base_ = robots::floating_base(robot);
  states_.assign(num_worlds, {});
}

void Follower::check_commands(const mjModel* model) const {
  for (const robots::Hand& hand : robots::hands_of(*robot_, model)) {
    if (hand.floats() || joints_are_commanded(hand.tool)) continue;
    throw ValueError(fmt::format(
        "policy 'planner' commands joint positions; the controller of move group '{}' of robot "
        "'{}' takes other commands",
        robot_->groups()[hand.tool].name, robot_->name()));
  }
}

bool Follower::joints_are_commanded(int group) const {
  const robots::MoveGroup& g = robot_->groups()[group];
  return g.targets_are_qpos() && g.commands_are_targets;
}

void Follower::reset(const World& world) {
  State& state = states_[world.id];
  restart(world);
  for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
    state.sent[g] = {};
    Sent& sent = state.sent[g].now;
    if (static_cast<int>(g) == floating_base_) {
      write_pose(robot_->base_pose(world), sent.values.data());
      sent.given = true;
    } else if (robot_->groups()[g].kind != robots::GroupKind::kGripper &&
               joints_are_commanded(static_cast<int>(g))) {
      sent.values = state.joints[g].values;
      sent.given = true;
    }
    sent.wanted = sent.values;
  }
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
  if (!state.plan.segments.empty()) enter(world, state, state.plan.segments[0]);
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

// Groups without a command use their measured positions, e.g. a torso below an arm.
void Follower::read_free_joints(const World& world, State& state) const {
  for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
    if (state.commands[g].given && joints_are_commanded(static_cast<int>(g))) continue;
    const auto& address = robot_->groups()[g].qpos;
    if (robot_->groups()[g].kind == robots::GroupKind::kArm) continue;
    for (std::size_t i = 0; i < address.size(); ++i)
      state.joints[g].values[i] = world.data->qpos[address[i]];
  }
}

bool Follower::move_tool(const World& world, State& state, const ToolMove& move, double time) {
  const double s = move.seconds == 0 ? 1.0 : std::min(1.0, time / move.seconds);
  const Pose pose = move.from * exp6((move.eased ? s * s * (3 - 2 * s) : s) * move.screw);
  state.targets[move.tool] = {true, move.in_world, pose};
  if (robot_->groups()[move.tool].kind ==
      robots::GroupKind::kGripper) {  // a floating base carries it
    const Pose to = move.in_world ? pose : robot_->base_pose(world) * pose;
    const Pose base = to * inverse(robot_->tcp_pose(world, move.tool));
    double command[7];
    write_pose(base, command);
    state.commands[floating_base_].set(command);
    return true;
  }
  const Pose target = move.in_world ? inverse(robot_->base_pose(world)) * pose : pose;
  const bool solved = robot_->ik(move.tool, target, state.joints, robots::Chain::kTracking);
  // If inverse kinematics fails, the last command stays.
  state.commands[move.tool].set(
      {state.joints[move.tool].values.data(), robot_->groups()[move.tool].qpos.size()});
  return solved;
}

void Follower::move_group(State& state, const CommandPath& path, double time) {
  const std::size_t n = robot_->groups()[path.group].command_size;
  const auto next = std::ranges::upper_bound(path.times, time);
  const std::size_t b = next - path.times.begin();
  robots::GroupValues& command = state.commands[path.group];
  if (b == 0 || b == path.times.size()) {
    command.set(std::span(path.points).subspan(b == 0 ? 0 : (b - 1) * n, n));
  } else {
    const double s = (time - path.times[b - 1]) / (path.times[b] - path.times[b - 1]);
    std::array<double, robots::GroupValues::kMaxSize> values;
    for (std::size_t i = 0; i < n; ++i) {
      const double from = path.points[(b - 1) * n + i], to = path.points[b * n + i];
      values[i] = from + s * (to - from);
    }
    command.set({values.data(), n});
  }
  if (!joints_are_commanded(path.group)) return;
  double maximum = 0;
  for (std::size_t i = 0; i < n; ++i)
    maximum = std::max(maximum, std::abs(state.offsets[path.group].values[i]));
  const double fade = std::min(path.times.back(), std::max(kFade, maximum / kFadeSpeed));
  if (state.offsets[path.group].given && time < fade) {
    const double s = time / fade, left = 1 - s * s * (3 - 2 * s);
    for (std::size_t i = 0; i < n; ++i)
      command.values[i] += left * state.offsets[path.group].values[i];
  }
  std::copy_n(command.values.begin(), n, state.joints[path.group].values.begin());
}

// Factor by which the duration of an eased screw must grow so that joints stay within their limits.
// With s = 3u^2 - 2u^3, u = t / T: dq/dt = q'(s) s' / T, d2q/dt2 = (q''(s) s'^2 + q'(s) s'') / T^2.
double Follower::stretch(const World& world, const State& state, const ToolMove& move) const {
  constexpr int kParts = 12;
  const robots::MoveGroup& arm = robot_->groups()[move.tool];
  const std::size_t n = arm.qpos.size();
  if (!move.eased || move.seconds <= 0 || arm.kind != robots::GroupKind::kArm) return 1;
  const Pose to_base = move.in_world ? inverse(robot_->base_pose(world)) : Pose{};
  std::array<std::array<double, robots::GroupValues::kMaxSize>, kParts + 1> q;
  robots::RobotValues at = state.joints;
  for (int k = 0; k <= kParts; ++k) {
    const Pose tool = to_base * move.from * exp6((static_cast<double>(k) / kParts) * move.screw);
    if (!robot_->ik(move.tool, tool, at, robots::Chain::kTracking)) return 1;
    q[k] = at[move.tool].values;
  }
  double factor = 1;
  const double ds = 1.0 / kParts;
  for (int k = 0; k <= kParts; ++k) {
    const int a = std::max(0, k - 1), b = std::min(kParts, k + 1),
              middle = std::clamp(k, 1, kParts - 1);
    // s' and s'' at s = k / kParts.
    const double s = k * ds;
    const double u = 0.5 - std::sin(std::asin(1 - 2 * s) / 3);
    const double rate = 6 * u * (1 - u), change = 6 - 12 * u;
    for (std::size_t i = 0; i < n; ++i) {
      const bool slide = slides_[move.tool][i];
      const double slope = (q[b][i] - q[a][i]) / ((b - a) * ds);
      const double bend = (q[middle + 1][i] - 2 * q[middle][i] + q[middle - 1][i]) / (ds * ds);
      const double v = std::abs(slope * rate) / move.seconds;
      const double acc =
          std::abs(bend * rate * rate + slope * change) / (move.seconds * move.seconds);
      factor = std::max(factor, v / (slide ? cfg_.slide_speed : cfg_.line_speed));
      factor = std::max(
          factor, std::sqrt(acc / (slide ? cfg_.slide_acceleration : cfg_.line_acceleration)));
    }
  }
  return factor;
}

// Inverse kinematics along a line ends near, but not at, the joint positions from which the next
// path was planned, since a redundant arm drifts. The offset fades out along the path.
void Follower::enter(const World& world, State& state, Segment& segment) const {
  double longer = 0;
  for (ToolMove& move : segment.tools) {
    const double factor = stretch(world, state, move);
    if (factor <= 1) continue;
    longer = std::max(longer, (factor - 1) * move.seconds);
    move.seconds *= factor;
  }
  segment.duration += longer;
  for (const CommandPath& path : segment.paths) {
    robots::GroupValues& offset = state.offsets[path.group];
    offset.given = state.commands[path.group].given && joints_are_commanded(path.group);
    if (!offset.given) continue;
    const std::size_t n = robot_->groups()[path.group].command_size;
    for (std::size_t i = 0; i < n; ++i) {
      offset.values[i] = state.joints[path.group].values[i] - path.points[i];
      if (is_yaw(path.group, i)) offset.values[i] = scenes::wrapped(offset.values[i]);
    }
  }
}

// A segment may end between two control steps or have no duration. Its end is commanded unless the
// next segment takes over.
void Follower::finish(const World& world, State& state, const Segment& done, const Segment& next) {
  for (const GripperCommand& grip : done.grippers)
    state.commands[grip.gripper].set({&grip.command, 1});
  for (const CommandPath& path : done.paths) move_group(state, path, done.duration);
  for (const ToolMove& move : done.tools) {
    const auto taken = [&](const ToolMove& other) { return other.tool == move.tool; };
    if (std::ranges::none_of(next.tools, taken)) move_tool(world, state, move, done.duration);
  }
}

namespace {

// Speed (with sign) that closes the distance `away` and stops there, with deceleration at most
// `maximum` at steps of dt.
double closing_speed(double away, double maximum, double dt) {
  const double far = std::abs(away);
  const double speed =
      std::min(far / dt, maximum * (std::sqrt(0.25 * dt * dt + 2 * far / maximum) - 0.5 * dt));
  return std::copysign(speed, away);
}

// fraction of the limit used for closing in; the rest is for following the target
constexpr double kBraking = 0.7;

}  // namespace

Follower::Sent& Follower::Sending::at(double step) {
  if (step != time) last = now;
  time = step;
  return now = last;
}

// Yaw of a mobile base: plans use an angle between -pi and pi, regardless of full turns.
bool Follower::is_yaw(int group, std::size_t joint) const {
  return robot_->groups()[group].kind == robots::GroupKind::kBase && !slides_[group][joint];
}

double Follower::max_acceleration(int group, std::size_t joint) const {
  const bool slide = slides_[group][joint];
  if (robot_->groups()[group].kind == robots::GroupKind::kBase)
    return slide ? cfg_.max_base_acceleration : cfg_.max_base_turn_acceleration;
  return slide ? cfg_.max_slide_acceleration : cfg_.max_acceleration;
}

// A command within the limits is not changed, bit for bit. Otherwise its rate changes at the limit
// until it has caught up.
void Follower::limit(int group, Sent& sent, std::span<double> command) const {
  sent.moved = true;
  for (std::size_t i = 0; i < command.size(); ++i) {
    const double maximum = max_acceleration(group, i);
    if (const double away = command[i] - sent.values[i];
        is_yaw(group, i) && scenes::wrapped(away) != away)
      command[i] = sent.values[i] + scenes::wrapped(away);
    const double wanted = command[i], follow = (wanted - sent.wanted[i]) / dt_;
    const double behind = sent.wanted[i] - sent.values[i], rate = sent.rates[i];
    double next = (wanted - sent.values[i]) / dt_;
    const bool turns =
        robot_->groups()[group].kind == robots::GroupKind::kArm && !slides_[group][i];
    const double fastest = turns ? cfg_.max_speed : std::numeric_limits<double>::infinity();
    if (behind != 0 || std::abs(next) > fastest || std::abs(next - rate) > maximum * dt_) {
      next = follow + closing_speed(behind, kBraking * maximum, dt_);
      next = std::clamp(next, -fastest, fastest);
      next = std::clamp(next, rate - maximum * dt_, rate + maximum * dt_);
      command[i] = sent.values[i] + next * dt_;
      if (std::abs(command[i] - wanted) < 1e-9) command[i] = wanted;
    }
    sent.rates[i] = next;
    sent.values[i] = command[i];
    sent.wanted[i] = wanted;
  }
}

void Follower::limit_pose(Sent& sent, std::span<double> command) const {
  const auto pose = [](const double* v) { return Pose{vec3(v), quat(v + 3)}; };
  const auto turn = [](const Quat& from, const Quat& to) {
    return rotate(from, log3(conjugate(from) * to));
  };
  const Pose last = pose(sent.values.data()), before = pose(sent.wanted.data()),
             wanted = pose(command.data());
  bool as_wanted = true;
  for (int part = 0; part < 2; ++part) {
    const double maximum = part == 0 ? cfg_.max_base_acceleration : cfg_.max_base_turn_acceleration;
    const auto displacement = [&](const Pose& from, const Pose& to) {
      return part == 0 ? to.p - from.p : turn(from.q, to.q);
    };
    const Vec3 rate = vec3(sent.rates.data() + 3 * part), behind = displacement(last, before);
    Vec3 next = (1 / dt_) * displacement(last, wanted);
    const double far = norm(behind);
    if (far > 1e-9 || norm(next - rate) > maximum * dt_) {
      next = (1 / dt_) * displacement(before, wanted);
      if (far > 0) next = next + (closing_speed(far, kBraking * maximum, dt_) / far) * behind;
      const double change = norm(next - rate);
      if (change > maximum * dt_) next = rate + (maximum * dt_ / change) * (next - rate);
      as_wanted = false;
    }
    write_vec(next, sent.rates.data() + 3 * part);
  }
  std::copy_n(command.begin(), 7, sent.wanted.begin());
  if (!as_wanted) {
    const Pose at{last.p + dt_ * vec3(sent.rates.data()),
                  normalized(exp3(dt_ * vec3(sent.rates.data() + 3)) * last.q)};
    write_pose(at, command.data());
  }
  std::copy_n(command.begin(), 7, sent.values.begin());
}

bool Follower::brake(const World& world, robots::Action& action) {
  bool at_rest = true;
  for (std::size_t g = 0; g < robot_->groups().size(); ++g)
    at_rest = rest(world, static_cast<int>(g), action) && at_rest;
  return at_rest;
}

// Brings a group without a command to rest. An arm then stays by command, a base without one.
bool Follower::rest(const World& world, int group, robots::Action& action) {
  Sent& sent = states_[world.id].sent[group].at(world.time());
  if (!sent.moved || group == floating_base_) return true;
  const std::size_t n = robot_->groups()[group].qpos.size();
  if (robot_->groups()[group].kind == robots::GroupKind::kBase &&
      std::ranges::all_of(sent.rates, [](double rate) { return rate == 0; }))
    return true;
  bool at_rest = true;
  for (std::size_t i = 0; i < n; ++i) {
    const double maximum = dt_ * max_acceleration(group, i);
    sent.rates[i] -= std::clamp(sent.rates[i], -maximum, maximum);
    sent.values[i] += sent.rates[i] * dt_;
    sent.wanted[i] = sent.values[i];
    at_rest = at_rest && sent.rates[i] == 0;
  }
  action.commands[group].set({sent.values.data(), n});
  return at_rest;
}

Pose Follower::tool_target(const World& world, int tool) const {
  const State& state = states_[world.id];
  if (robot_->groups()[tool].kind != robots::GroupKind::kArm) {
    const Target& target = state.targets[tool];
    if (!target.given) return robot_->tcp_pose(world, tool);
    return target.in_world ? inverse(robot_->base_pose(world)) * target.pose : target.pose;
  }
  if (!state.commands[tool].given) return robot_->tcp_pose(world, tool);
  return robot_->fk(tool, state.joints);
}

void Follower::follow(const World& world, robots::Action& action) {
  State& state = states_[world.id];
  auto& segments = state.plan.segments;
  const auto n = static_cast<int>(segments.size());
  while (state.segment < n && world.time() - state.start >= segments[state.segment].duration) {
    state.start += segments[state.segment].duration;
    ++state.segment;
    if (state.segment == n) break;
    finish(world, state, segments[state.segment - 1], segments[state.segment]);
    enter(world, state, segments[state.segment]);
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
    // Arms without a tool move: the target follows from their commanded joints.
    for (std::size_t g = 0; g < robot_->groups().size(); ++g) {
      const bool arm =
          robot_->groups()[g].kind == robots::GroupKind::kArm && state.commands[g].given;
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
    const robots::MoveGroup& group = robot_->groups()[g];
    const robots::GroupValues& command = state.commands[g];
    if (command.given) {
      action.commands[g].set(command.view());
      robots::GroupValues& sent = action.commands[g];
      const std::span<double> values(sent.values.data(), static_cast<std::size_t>(sent.size));
      if (dt_ > 0 && state.sent[g].now.given) {
        Sent& last = state.sent[g].at(world.time());
        if (static_cast<int>(g) == floating_base_) {
          limit_pose(last, values);
        } else {
          limit(static_cast<int>(g), last, values);
        }
      }
    } else if (group.kind == robots::GroupKind::kBase && !group.controlled()) {
      action.commands[g].set({});  // a mobile base gets no command: it holds
    } else {
      rest(world, static_cast<int>(g), action);
    }
  }
}

}  // namespace mjsense::tasks::policies
