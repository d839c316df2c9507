// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/plan.h"

#include <algorithm>
#include <utility>

namespace mjsense::tasks::policies {

Segment& Plan::move_tool(int phase, int tool, const Pose& from, const Pose& to, double speed,
                         double settle, double turn) {
  ToolMove move{.tool = tool, .from = from, .screw = log6(inverse(from) * to)};
  move.seconds = std::max(norm(move.screw.v) / speed, norm(move.screw.w) / turn);
  Segment& segment = wait(phase, move.seconds + settle);
  segment.tools.push_back(move);
  return segment;
}

Segment& Plan::move_tool_in_world(int phase, int tool, const Pose& from, const Pose& to,
                                  double speed, double settle, double turn) {
  Segment& segment = move_tool(phase, tool, from, to, speed, settle, turn);
  segment.tools.back().in_world = true;
  return segment;
}

Segment& Plan::ease_tool(int phase, int tool, const Pose& from, const Pose& to, double speed,
                         double settle, double turn, bool in_world) {
  Segment& segment =
      in_world ? move_tool_in_world(phase, tool, from, to, speed / 1.5, settle, turn / 1.5)
               : move_tool(phase, tool, from, to, speed / 1.5, settle, turn / 1.5);
  segment.tools.back().eased = true;
  return segment;
}

Segment& Plan::move_groups(int phase, std::vector<CommandPath> paths, double settle) {
  double seconds = 0;
  for (const CommandPath& path : paths) seconds = std::max(seconds, path.times.back());
  Segment& segment = wait(phase, seconds + settle);
  segment.paths = std::move(paths);
  return segment;
}

Segment& Plan::wait(int phase, double seconds) {
  Segment& segment = segments.emplace_back();
  segment.phase = phase;
  segment.duration = seconds;
  return segment;
}

void ease(std::span<double> seconds) {
  constexpr double kEnds = 2.5, kChange = 0.75;
  if (seconds.empty()) return;
  seconds.front() *= kEnds;
  seconds.back() *= kEnds;
  for (std::size_t i = 1; i < seconds.size(); ++i)
    seconds[i] = std::max(seconds[i], kChange * seconds[i - 1]);
  for (std::size_t i = seconds.size(); i-- > 1;)
    seconds[i - 1] = std::max(seconds[i - 1], kChange * seconds[i]);
}

}  // namespace mjsense::tasks::policies
