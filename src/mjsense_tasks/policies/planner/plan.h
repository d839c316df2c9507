// SPDX-License-Identifier: Apache-2.0
#pragma once
// A plan: a sequence of segments, each with a phase and the motions of the move groups. Planners
// make plans; the Follower (plan_follower.h) executes them.

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::tasks::policies {

// Moves the tool of a group from one pose to another along a screw; afterwards it stays.
struct ToolMove {
  int tool = -1;  // group that has the tool as its leaf: an arm, or a gripper on a floating base
  Pose from;      // X_BT, base frame; X_WT where in_world
  Twist screw;    // log6(from^-1 to)
  double seconds = 0;     // duration of the motion
  bool in_world = false;  // poses are in the world frame: motion of the base is compensated
  bool eased = false;     // smooth start and stop instead of constant speed
};

// Commands of a group along a path, linear between its points; after the last point they stay.
struct CommandPath {
  int group = -1;
  std::vector<double> times;  // [N] s from the start of the segment, increasing
  // [N, n] in the format of the group's controller; n = MoveGroup::command_size.
  std::vector<double> points;
};

struct GripperCommand {
  int gripper = -1;  // group index
  double command = 0;
};

// A command stays in effect until a later segment commands the same group.
struct Segment {
  int phase = 0;
  double duration = 0;  // s
  std::vector<ToolMove> tools;
  std::vector<CommandPath> paths;
  std::vector<GripperCommand> grippers;
  std::vector<int> holding;  // grippers that must hold an object: the plan fails if one is empty

  Segment& grip(int gripper, double command) {
    grippers.push_back({gripper, command});
    return *this;
  }
  Segment& holds(int gripper) {
    holding.push_back(gripper);
    return *this;
  }
};

struct Plan {
  std::vector<Segment> segments;  // empty: no plan was found
  std::string rejection;          // reason for that, shown to users; may be empty
  Pose grasp;                     // X_WT that policies record; kept from plan to plan
  // The task needs a further stage that cannot be planned yet. The planner is called for it when
  // these segments are done.
  bool more = false;

  void clear() {
    segments.clear();
    rejection.clear();
    more = false;
  }
  // Moves the tool at `speed` (m/s) and at most `turn` (rad/s), then waits for `settle` s.
  // References to segments are valid until the next one is added.
  Segment& move_tool(int phase, int tool, const Pose& from, const Pose& to, double speed,
                     double settle = 0, double turn = std::numeric_limits<double>::infinity());
  // The same with poses in the world frame.
  Segment& move_tool_in_world(int phase, int tool, const Pose& from, const Pose& to, double speed,
                              double settle = 0,
                              double turn = std::numeric_limits<double>::infinity());
  // Smooth motion from rest to rest that reaches `speed` and `turn` in the middle and so takes 1.5
  // times as long. Poses are in the world frame or, as for move_tool(), relative to the base.
  Segment& ease_tool(int phase, int tool, const Pose& from, const Pose& to, double speed,
                     double settle, double turn, bool in_world);
  // Groups follow their paths at the same time; the duration is that of the longest path plus
  // `settle`.
  Segment& move_groups(int phase, std::vector<CommandPath> paths, double settle = 0);
  Segment& wait(int phase, double seconds);
};

// Lengthens the durations between path points, so that the motion is slow at both ends and speeds
// change gradually: a handle or a held object can be heavy.
void ease(std::span<double> seconds);

}  // namespace mjsense::tasks::policies
