// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base placement of a robot in a scene that was made for a different robot. The base is moved
// forward or back, and the robot stoops if it can, until its hands reach the target areas. A
// floating hand is placed above them.

#include "mjsense_tasks/robots/robot.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {

class BasePlacementSearch {
 public:
  BasePlacementSearch() = default;
  // Keeps the scene's base pose if a hand can reach nearly all of the target areas from there.
  // Otherwise selects the collision-free offset forward or back with the most reachable grasp
  // poses. If it does not reach nearly all of the target areas either, the robot stoops
  // (Robot::stoop) if that increases the number. If that is still not enough, targets are limited to
  // the regions of which a hand reaches at least half, unless there is none.
  BasePlacementSearch(const mjModel* model, robots::Robot& robot, EpisodeScene& scene);
  // Returns X_WB for an episode in which the scene gives `scene_pose`.
  Pose operator()(const Pose& scene_pose) const { return scene_pose * offset_; }
  const Pose& offset() const { return offset_; }

 private:
  Pose offset_;
};

}  // namespace mjsense::tasks::scenes
