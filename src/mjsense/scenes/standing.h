// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where a robot stands in a scene that was made for another: nearer or farther, stooped if it can, so
// that its hands reach where the targets are; a floating hand hangs above them.

#include "mjsense/robots/robot.h"
#include "mjsense/scenes/episode_scene.h"

namespace mjsense {

class Standing {
 public:
  Standing() = default;
  // Where the scene says, if a hand reaches nearly all of the target areas from there; otherwise the place ahead
  // or behind that is free of the scene and from which most ways lead to them. Where that is not nearly all
  // either, the robot stoops (Robot::stoop), if more do then. If that is still not enough, targets are limited to
  // the regions of which a hand reaches at least half, unless there is none.
  Standing(const mjModel* model, Robot& robot, EpisodeScene& scene);
  // X_WB for an episode in which the scene says `scene_pose`.
  Pose operator()(const Pose& scene_pose) const { return scene_pose * offset_; }
  const Pose& offset() const { return offset_; }

 private:
  Pose offset_;
};

}  // namespace mjsense
