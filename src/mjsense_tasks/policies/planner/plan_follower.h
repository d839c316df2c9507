// SPDX-License-Identifier: Apache-2.0
#pragma once
// Follows one plan in each world by simulation time: computes the commands of all groups and
// detects failures. It allocates no memory while following.

#include <array>
#include <span>
#include <string_view>
#include <vector>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense_tasks/policies/planner/plan.h"
#include "mjsense_tasks/robots/hands.h"

namespace mjsense::tasks::policies {

enum class PlanFailure {
  kNone,
  kUnplanned,
  kToolAway,
  kToolTurned,
  kDropped,
  kUnreachable,
  kAstray
};
constexpr std::array<std::string_view, 7> enum_names(PlanFailure) {
  return {"none", "unplanned", "tool_away", "tool_turned", "dropped", "unreachable", "astray"};
}

struct FollowerCfg {
  double max_position_error = 0.1;     // m, of the tool from its target
  double max_rotation_error = 0.5236;  // rad (30 degrees)
  double min_held_opening = 0.002;     // m; a smaller opening means that nothing is held
  int max_ik_failures = 8;             // consecutive
  // Joint limits during an eased tool move along a screw: it is slowed down if inverse kinematics
  // would exceed them. Slides: m/s, m/s^2.
  double line_speed = 1.5, line_acceleration = 4.0;  // rad/s, rad/s^2
  double slide_speed = 0.3, slide_acceleration = 1.0;
  // Limits of commands between control steps, independent of the plan; they also apply when a plan
  // is aborted during a motion. For arm joints and bases.
  double max_acceleration = 10, max_slide_acceleration = 2.5;           // rad/s^2, m/s^2
  double max_speed = 2.62;                                              // rad/s, arm joints
  double max_base_acceleration = 3.0, max_base_turn_acceleration = 10;  // m/s^2, rad/s^2
};

// A function that takes a world accesses the state of that world only and may run in parallel with
// calls for other worlds.
class Follower {
 public:
  explicit Follower(FollowerCfg cfg = {}) : cfg_(cfg) {}
  // `dt`: period of the commands, s; 0: accelerations are not limited.
  void initialize(const robots::Robot& robot, const mjModel* model, int num_worlds, double dt = 0);
  // Throws ValueError for an arm whose commands are not joint positions, which cannot follow a plan.
  void check_commands(const mjModel* model) const;

  Plan& plan(int world) { return states_[world].plan; }
  const Plan& plan(int world) const { return states_[world].plan; }
  // Starts an episode: the robot is at rest. Includes restart().
  void reset(const World& world);
  // Uses the robot's measured state and drops the commands of the previous plan. Call it before
  // planning, so that tool_target() and joints() return where the plan begins.
  void restart(const World& world);
  // Starts the plan, from the last commands unless restart() was called.
  void begin(const World& world);
  // How following has failed; kNone if it has not.
  PlanFailure failure(const World& world) const;
  // Commands for the next control step.
  void follow(const World& world, robots::Action& action);
  // Commands for a control step without a plan: moving groups are brought to rest. Returns true
  // once all are at rest.
  bool brake(const World& world, robots::Action& action);
  bool finished(int world) const { return states_[world].finished; }
  int phase(int world) const { return states_[world].phase; }
  void set_phase(int world, int phase) { states_[world].phase = phase; }
  // Index in plan().segments; their number if the plan is finished.
  int segment(int world) const { return states_[world].segment; }

  // Commanded X_BT of a group's tool; the measured one if there is no command.
  Pose tool_target(const World& world, int tool) const;
  // Commanded joint positions; measured ones for groups without such commands.
  const robots::RobotValues& joints(int world) const { return states_[world].joints; }

 private:
  struct Target {
    bool given = false, in_world = false;
    Pose pose;
  };
  // The last command and its rates: n values of an arm or a mobile base; X_WB of a floating base,
  // with three rates of the position and three of the rotation, world frame.
  struct Sent {
    bool given = false;  // commands of this group are limited
    bool moved = false;  // was commanded in this episode
    std::array<double, robots::GroupValues::kMaxSize> values{}, wanted{}, rates{};
  };
  // A step may be planned and commanded more than once; each time starts from what the previous
  // step sent.
  struct Sending {
    double time = -1;  // s, of the step
    Sent last, now;
    Sent& at(double step);
  };
  struct State {
    Plan plan;
    int segment = 0;
    double start = 0;  // s, simulation time at which the segment began
    bool finished = false;
    int phase = 0;
    int ik_failures = 0;
    robots::RobotValues joints, commands;
    // Joint offsets from the start of the path that is followed; `given` if there are any.
    robots::RobotValues offsets;
    std::array<Target, robots::RobotValues::kMaxGroups> targets;  // per tool group
    std::array<Sending, robots::RobotValues::kMaxGroups> sent;
  };
  void read_free_joints(const World& world, State& state) const;
  bool move_tool(const World& world, State& state, const ToolMove& move, double time);
  void move_group(State& state, const CommandPath& path, double time);
  void enter(const World& world, State& state, Segment& segment) const;
  bool rest(const World& world, int group, robots::Action& action);
  double stretch(const World& world, const State& state, const ToolMove& move) const;
  bool is_yaw(int group, std::size_t joint) const;
  double max_acceleration(int group, std::size_t joint) const;
  void limit(int group, Sent& sent, std::span<double> command) const;
  void limit_pose(Sent& sent, std::span<double> command) const;
  void finish(const World& world, State& state, const Segment& done, const Segment& next);
  bool joints_are_commanded(int group) const;

  FollowerCfg cfg_;
  const robots::Robot* robot_ = nullptr;
  int floating_base_ = -1;  // group whose commands are base poses; -1: none
  double dt_ = 0;
  std::vector<std::vector<char>> slides_;  // [group][joint]: the joint is a slide
  std::vector<State> states_;              // [B]
};

}  // namespace mjsense::tasks::policies
