// SPDX-License-Identifier: Apache-2.0
#pragma once
// Follows one plan a world by simulation time: commands of every group at this moment, and whether
// the robot still does what it is told. Nothing is allocated while following.

#include <array>
#include <vector>

#include "mjsense/core/fields.h"
#include "mjsense/policies/planner/plan.h"
#include "mjsense/robots/robot.h"

namespace mjsense {

enum class PlanFailure {
  kNone,
  kUnplanned,
  kToolAway,
  kToolTurned,
  kDropped,
  kUnreachable,
  kAstray
};
template <>
inline constexpr std::array<std::string_view, 7> kWords<PlanFailure>{
    "none", "unplanned", "tool_away", "tool_turned", "dropped", "unreachable", "astray"};

struct FollowerCfg {
  double max_position_error = 0.1;     // m, tool against its target
  double max_rotation_error = 0.5236;  // rad (30 degrees)
  double min_held_opening = 0.002;     // m: less between the fingers means nothing is held
  int max_ik_failures = 8;             // in a row
  // Of joints while a tool goes eased along a screw: it takes longer where inverse kinematics would
  // exceed them. Slides: m/s, m/s^2.
  double line_speed = 1.5, line_acceleration = 4.0;  // rad/s, rad/s^2
  double slide_speed = 0.3, slide_acceleration = 1.0;
  // Of commands from one control step to the next, whatever plans say: where a plan is given up in
  // the midst of a motion, too. Of arms' joints, and of bases.
  double most_acceleration = 10, most_slide_acceleration = 2.5;           // rad/s^2, m/s^2
  double most_speed = 2.62;                                               // rad/s, of arms
  double most_base_acceleration = 3.0, most_base_turn_acceleration = 10;  // m/s^2, rad/s^2
};

// A gripper and what moves it.
struct Hand {
  int gripper = -1;  // group
  int tool = -1;     // group that ToolMove names: its arm; the gripper itself on a floating base
};
// The hands of a robot, in the order of its grippers. A gripper hangs on the arm with the same leaf
// site, else on the one whose root body it is below; one that nothing moves is left out.
std::vector<Hand> hands_of(const Robot& robot, const mjModel* model);

// Functions that take a world touch that world's state alone and may run in parallel.
class Follower {
 public:
  explicit Follower(FollowerCfg cfg = {}) : cfg_(cfg) {}
  // Throws ValueError for an arm whose commands are no joint positions. `dt`: seconds between two
  // commands; 0: their accelerations are not limited.
  void initialize(const Robot& robot, const mjModel* model, int num_worlds, double dt = 0);

  Plan& plan(int world) { return states_[world].plan; }
  const Plan& plan(int world) const { return states_[world].plan; }
  // A new episode: the robot is at rest, then as restart().
  void reset(const World& world);
  // The robot is taken as it stands; commands of an earlier plan are forgotten. Before planning, so
  // that tool_target() and joints() say where the plan begins.
  void restart(const World& world);
  // The plan begins now; unless restart() was called, from the last commands.
  void begin(const World& world);
  // What is wrong with how the world follows; kNone while nothing is.
  PlanFailure failure(const World& world) const;
  // Commands for the next control step.
  void follow(const World& world, Action& action);
  // Commands for a control step without a plan: arms that move come to rest. True once they are.
  bool brake(const World& world, Action& action);
  bool finished(int world) const { return states_[world].finished; }
  int phase(int world) const { return states_[world].phase; }
  void set_phase(int world, int phase) { states_[world].phase = phase; }
  // Index in plan().segments; their number where finished.
  int segment(int world) const { return states_[world].segment; }

  // X_BT where the tool of a group is commanded to be; where it is, if nothing is commanded.
  Pose tool_target(const World& world, int tool) const;
  // Joint positions as commanded, of groups without such commands as they are.
  const RobotValues& joints(int world) const { return states_[world].joints; }

 private:
  struct Target {
    bool given = false, in_world = false;
    Pose pose;
  };
  // What was commanded last, and how it moved: n values of an arm or a base that drives; X_WB of a floating base, of whose
  // pose the rates are three of the position and three of the rotation, in the world.
  struct Sent {
    bool given = false;  // it is limited
    bool moved = false;  // it was commanded in this episode
    std::array<double, GroupValues::kMaxSize> values{}, wanted{}, rates{};
  };
  // A step may be planned, and commanded, more than once: each time from what the step before sent.
  struct Sending {
    double time = -1;  // s, of the step
    Sent last, now;
    Sent& at(double step);
  };
  struct State {
    Plan plan;
    int segment = 0;
    double start = 0;  // s, simulation time, of the segment
    bool finished = false;
    int phase = 0;
    int ik_failures = 0;
    RobotValues joints, commands;
    RobotValues
        offsets;  // of joints from the path that they are about to follow, `given` where there are
    std::array<Target, RobotValues::kMaxGroups> targets;  // per tool
    std::array<Sending, RobotValues::kMaxGroups> sent;
  };
  void read_free_joints(const World& world, State& state) const;
  bool move_tool(const World& world, State& state, const ToolMove& move, double time);
  void move_group(State& state, const CommandPath& path, double time);
  void enter(const World& world, State& state, Segment& segment) const;
  bool rest(const World& world, int group, Action& action);
  double stretch(const World& world, const State& state, const ToolMove& move) const;
  bool is_yaw(int group, std::size_t joint) const;
  double most_acceleration(int group, std::size_t joint) const;
  void limit(int group, Sent& sent, std::span<double> command) const;
  void limit_pose(Sent& sent, std::span<double> command) const;
  void finish(const World& world, State& state, const Segment& done, const Segment& next);
  bool joints_are_commanded(int group) const;

  FollowerCfg cfg_;
  const Robot* robot_ = nullptr;
  int floating_base_ = -1;  // group whose commands are poses of the base
  double dt_ = 0;
  std::vector<std::vector<char>> slides_;  // per group, per joint
  std::vector<State> states_;              // [B]
};

}  // namespace mjsense
