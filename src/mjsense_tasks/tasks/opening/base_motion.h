// SPDX-License-Identifier: Apache-2.0
#pragma once
// Motions of a mobile base while its arm moves a handle.

#include <vector>

#include "mjsense_tasks/scenes/base_planner.h"
#include "mjsense_tasks/tasks/opening/articulation.h"

namespace mjsense::tasks {

// Motion of an articulation in the world frame.
struct HandleMotion {
  const Articulation* one = nullptr;
  double from = 0, to = 0;  // rad or m, joint positions
  Vec3 axis, anchor;        // world frame
  // Motion of its body since the joint was at `from`. `part`: fraction of the motion, 0 to 1.
  Pose at(double part) const { return one->motion(from, from + part * (to - from), axis, anchor); }
};

// Base motion while the handle is held: a share of the handle's motion plus a straight offset.
struct Drive {
  double share = 0;  // share of the articulation's motion; 1: the base moves rigidly with it
  double x = 0, y = 0, turn = 0;  // m and rad, world frame, offset at the end
};

// Base pose after a fraction `part` (0 to 1) of the motion, starting at `from`. `tool`: position of
// the tool at the start, m, world frame.
scenes::BasePose driven(const scenes::BasePose& from, const Drive& drive,
                        const HandleMotion& motion, Vec3 tool, double part);

// Candidates by increasing cost. Short drives that keep the arm's posture come first.
const std::vector<Drive>& drives();

}  // namespace mjsense::tasks
