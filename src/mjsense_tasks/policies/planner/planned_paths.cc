// SPDX-License-Identifier: Apache-2.0
// The ways of the tools that a plan contains, as poses in the world.

#include "mjsense_tasks/policies/planner/task_planner.h"

namespace mjsense::tasks::policies {
namespace {

constexpr int kSamples = 8;  // poses per tool move, and between two points of a short path
constexpr std::size_t kMaxShort = 16;  // points of a short path; longer ones are dense enough

std::vector<Pose> poses_of(const ToolMove& move, const Pose& base) {
  std::vector<Pose> poses;
  for (int k = 0; k <= kSamples; ++k) {
    const Pose pose = move.from * exp6((static_cast<double>(k) / kSamples) * move.screw);
    poses.push_back(move.in_world ? pose : base * pose);
  }
  return poses;
}

// Leaves the joints at the end of the path.
std::vector<Pose> poses_of(const CommandPath& path, const robots::Robot& robot, const Pose& base,
                           robots::RobotValues& joints) {
  std::vector<Pose> poses;
  const std::size_t n = robot.groups()[path.group].qpos.size();
  std::vector<double> values(n);
  const int samples = path.times.size() > kMaxShort ? 1 : kSamples;
  for (std::size_t i = 0; i < path.times.size(); ++i) {
    for (int k = i == 0 ? samples : 1; k <= samples; ++k) {
      const double s = static_cast<double>(k) / samples;
      for (std::size_t j = 0; j < n; ++j) {
        const double from = path.points[(i == 0 ? 0 : i - 1) * n + j];
        values[j] = from + s * (path.points[i * n + j] - from);
      }
      joints[path.group].set(values);
      poses.push_back(base * robot.fk(path.group, joints));
    }
  }
  return poses;
}

}  // namespace

std::vector<episode::PlannedPath> TaskPlanner::planned_paths(const World& world) const {
  const Pose base = robot().base_pose(world);
  robots::RobotValues joints = follower_.joints(world.id);
  std::vector<episode::PlannedPath> paths;
  for (const Segment& segment : follower_.plan(world.id).segments) {
    std::string_view phase;
    for (const episode::Phase& one : phases()) {
      if (one.number == segment.phase) phase = one.name;
    }
    for (const ToolMove& move : segment.tools) paths.push_back({phase, poses_of(move, base)});
    for (const CommandPath& path : segment.paths) {
      if (robot().groups()[path.group].kind == robots::GroupKind::kArm)
        paths.push_back({phase, poses_of(path, robot(), base, joints)});
    }
  }
  return paths;
}

}  // namespace mjsense::tasks::policies
