// SPDX-License-Identifier: Apache-2.0
#pragma once
// The robot at its start configuration and the floor around it, for tasks with mobile robots.

#include <mujoco/mujoco.h>

#include <functional>
#include <memory>
#include <optional>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense_tasks/robots/robot.h"
#include "mjsense_tasks/scenes/occupancy_grid.h"

namespace mjsense::tasks::scenes {

// Index of the group that commands x, y (m) and yaw (rad) of a mobile base; -1: none.
int driving_base(const robots::Robot& robot);

// Height (m) of the level plane under the wheels; empty if there is none.
std::optional<double> ground_height(const mjModel* model);

// The compiled model with the robot's groups at their start positions, with its own mjData.
class RestingRobot {
 public:
  RestingRobot(const mjModel* model, const robots::Robot& robot);
  const mjData* data() const { return data_.get(); }
  Footprint footprint() const;
  // Footprint without the arms.
  Footprint trunk() const;
  // Obstacles for a robot of this height (m): all colliding geoms except the robot, loose objects
  // and geoms for which `without` is true. Doors are at their model positions; furniture occupies
  // all positions that `elsewhere` returns (OccupancyCfg).
  OccupancyGrid occupancy(double height,
                          const std::function<std::vector<Pose>(int geom)>& elsewhere = {},
                          const std::function<bool(int geom)>& without = {}) const;

 private:
  bool of_robot(int geom) const;

  const mjModel* model_;
  const robots::Robot& robot_;
  DataPtr data_;
};

}  // namespace mjsense::tasks::scenes
