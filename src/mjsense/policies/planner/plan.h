// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a robot is to do next: segments one after the other, each with a phase and what the move
// groups do in it. Planners make plans; the Follower (follower.h) follows them.

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

// The tool of a group goes from one pose to another on a screw, then stays.
struct ToolMove {
  int tool = -1;          // group whose leaf it is: an arm, or a gripper on a floating base
  Pose from;              // X_BT, base frame; X_WT where in_world
  Twist screw;            // log6(from^-1 to)
  double seconds = 0;     // of the way
  bool in_world = false;  // what the base does meanwhile is made up for
  bool eased = false;     // from rest to rest, instead of at one speed
};

// Commands of a group along a path; they change linearly between its points, then stay.
struct CommandPath {
  int group = -1;
  std::vector<double> times;  // [N] s from the beginning of the segment, rising
  std::vector<double>
      points;  // [N, n] as the group's controller takes them (MoveGroup::command_size)
};

struct GripperCommand {
  int gripper = -1;  // group
  double command = 0;
};

// What is commanded stands until another segment commands the same group.
struct Segment {
  int phase = 0;
  double duration = 0;  // s
  std::vector<ToolMove> tools;
  std::vector<CommandPath> paths;
  std::vector<GripperCommand> grippers;
  std::vector<int> holding;  // grippers that hold something: closed on nothing is a failure

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
  std::vector<Segment> segments;  // none: there is no way
  std::string refusal;            // then why, for people; "" is allowed
  Pose grasp;                     // X_WT that policies record; kept from plan to plan
  // There is more to do than can be planned yet: when these segments are done, the planner is asked
  // for the next stage.
  bool more = false;

  void clear() {
    segments.clear();
    refusal.clear();
    more = false;
  }
  // The tool goes at `speed` (m/s, and where given `turn` rad/s) and waits for `settle` s. References
  // to segments hold until the next is added.
  Segment& move_tool(int phase, int tool, const Pose& from, const Pose& to, double speed,
                     double settle = 0, double turn = std::numeric_limits<double>::infinity());
  // The same with poses in the world frame.
  Segment& move_tool_in_world(int phase, int tool, const Pose& from, const Pose& to, double speed,
                              double settle = 0,
                              double turn = std::numeric_limits<double>::infinity());
  // From rest to rest, at `speed` and `turn` in the middle; so it takes half as long again. In the world
  // or, like move_tool(), relative to the base.
  Segment& ease_tool(int phase, int tool, const Pose& from, const Pose& to, double speed,
                     double settle, double turn, bool in_world);
  // One or more groups follow their paths at the same time: seconds of the longest and `settle`.
  Segment& move_groups(int phase, std::vector<CommandPath> paths, double settle = 0);
  Segment& wait(int phase, double seconds);
};

// Of the seconds to each point of a path from the one before: slow at its ends, and never much faster than a
// moment before or after. What hangs on the hand is heavy.
void ease(std::span<double> seconds);

}  // namespace mjsense
