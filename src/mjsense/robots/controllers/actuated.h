// SPDX-License-Identifier: Apache-2.0
#pragma once
// What controllers share whose targets are positions of the group's actuators.

#include <set>

#include "mjsense/robots/controllers/controller.h"

namespace mjsense {

// Whether an actuator is a servo of a joint's position: its control is that position.
bool is_position_servo(const mjModel* model, int actuator);
// Likewise of a joint's velocity.
bool is_velocity_servo(const mjModel* model, int actuator);

class ActuatedController : public Controller {
 public:
  ActuatedController(const MoveGroup& group, const ControllerInit& init);

  void describe(MoveGroup& group) const override;
  void start(const StateRow& state) const override;
  void hold(const World& world, std::span<double> target) override;
  // The target; 0 where there is none.
  void keep(const World& world, std::span<const double> target,
            std::span<double> command) const override;
  void begin(const World& world, std::span<const double> target, const StateRow& state) override;

 protected:
  int size() const { return static_cast<int>(group_.actuators.size()); }
  double clip(int i, double value) const;
  // Position of the joint of actuator i.
  double position(const World& world, int i) const { return world.data->qpos[qpos_[i]]; }
  // ValueError unless every actuator is a servo of a joint's position, or, with `joints`, there are
  // that many.
  void need_position_servos(const ControllerInit& init, const char* kind, int count = 0) const;
  std::string position_unit(int i) const;
  std::string joined_units() const;

  const mjModel* model_;
  MoveGroup group_;
  std::vector<int> qpos_;  // by actuator: where its joint stands; -1: it has none
};

// Commands are changes or speeds: 0 leaves the group as it is.
class ChangeController : public ActuatedController {
 public:
  using ActuatedController::ActuatedController;
  void keep(const World& world, std::span<const double> target,
            std::span<double> command) const override;
};

}  // namespace mjsense
