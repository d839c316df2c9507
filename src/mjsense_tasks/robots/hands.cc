// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/hands.h"

#include <algorithm>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"

namespace mjsense::tasks::robots {
namespace {

// Index of the first group for which `matches` is true; -1: none.
template <class Matches>
int find_group(const Robot& robot, Matches&& matches) {
  const auto at = std::ranges::find_if(robot.groups(), matches);
  return at == robot.groups().end() ? -1 : static_cast<int>(at - robot.groups().begin());
}

}  // namespace

std::vector<Hand> hands_of(const Robot& robot, const mjModel* model) {
  std::vector<Hand> hands;
  for (int g = 0; g < static_cast<int>(robot.groups().size()); ++g) {
    const MoveGroup& gripper = robot.groups()[g];
    if (gripper.kind != GroupKind::kGripper || gripper.leaf_site < 0) continue;
    int tool = find_group(robot, [&](const MoveGroup& group) {
      return group.kind == GroupKind::kArm && group.leaf_site == gripper.leaf_site;
    });
    if (tool < 0) {
      tool = find_group(robot, [&](const MoveGroup& group) {
        return group.kind == GroupKind::kArm && group.leaf_site >= 0 &&
               observe::is_descendant_or_self(model, gripper.root_body, group.root_body);
      });
    }
    if (tool < 0 && floating_base(robot) >= 0) tool = g;
    if (tool >= 0) hands.push_back({g, tool});
  }
  return hands;
}

int floating_base(const Robot& robot) {
  return find_group(robot, [](const MoveGroup& group) {
    return group.kind == GroupKind::kBase && group.command_size == 7;
  });
}

Vec3 between_pads(const mjData* data, const MoveGroup& gripper) {
  const Pose tool = site_pose(data, gripper.leaf_site);
  return rotate(conjugate(tool.q), vec3(data->site_xpos + 3 * gripper.pad_sites[1]) -
                                       vec3(data->site_xpos + 3 * gripper.pad_sites[0]));
}

}  // namespace mjsense::tasks::robots
