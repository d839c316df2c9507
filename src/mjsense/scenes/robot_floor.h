// SPDX-License-Identifier: Apache-2.0
#pragma once
// A robot as it starts, and the floor around it, for tasks whose robots drive.

#include <mujoco/mujoco.h>

#include <functional>
#include <memory>
#include <optional>

#include "mjsense/robots/robot.h"
#include "mjsense/scenes/occupancy.h"

namespace mjsense {

// Index of the group whose commands are x, y (m) and yaw (rad) of a base on the floor; -1: there is none.
int driving_base(const Robot& robot);

// Of the level plane on which wheels stand, m; nothing where there is none.
std::optional<double> ground_height(const mjModel* model);

// The model as it is compiled, the robot's groups at their start positions, on data of its own.
class RestingRobot {
 public:
  RestingRobot(const mjModel* model, const Robot& robot);
  const mjData* data() const { return data_.get(); }
  Footprint footprint() const;
  // Without its arms.
  Footprint trunk() const;
  // What is in the way of a robot so high (m): everything that touches but the robot and what lies
  // about freely, and what `without` names. Doors stand as the model has them, furniture wherever `elsewhere` says
  // (OccupancyCfg).
  Occupancy occupancy(double height,
                      const std::function<std::vector<Pose>(int geom)>& elsewhere = {},
                      const std::function<bool(int geom)>& without = {}) const;

 private:
  struct Delete {
    void operator()(mjData* data) const { mj_deleteData(data); }
  };
  bool of_robot(int geom) const;

  const mjModel* model_;
  const Robot& robot_;
  std::unique_ptr<mjData, Delete> data_;
};

}  // namespace mjsense
