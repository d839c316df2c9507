// SPDX-License-Identifier: Apache-2.0
#pragma once
// Base classes of controllers with one target for each actuator of the group.

#include <set>

#include "mjsense_tasks/robots/controllers/controller.h"

namespace mjsense::tasks::robots {

// True if the actuator is a position servo of a joint: its control is the joint position.
bool is_position_servo(const mjModel* model, int actuator);
// True if the actuator is a velocity servo of a joint.
bool is_velocity_servo(const mjModel* model, int actuator);

class ActuatedController : public Controller {
 public:
  ActuatedController(const MoveGroup& group, const ControllerInit& init);

  void describe(MoveGroup& group) const override;
  void start(const StateRow& state) const override;
  void hold(const World& world, std::span<double> target) override;
  // The command is the target; 0 without a target.
  void keep(const World& world, std::span<const double> target,
            std::span<double> command) const override;
  void begin(const World& world, std::span<const double> target, const StateRow& state) override;

 protected:
  int size() const { return static_cast<int>(group_.actuators.size()); }
  double clip(int i, double value) const;
  // Position of the joint of actuator i.
  double position(const World& world, int i) const { return world.data->qpos[qpos_[i]]; }
  // Throws ValueError unless every actuator is a position servo of a joint and, if count > 0, the
  // group has `count` actuators.
  void need_position_servos(const ControllerInit& init, const char* kind, int count = 0) const;
  std::string position_unit(int i) const;
  std::string joined_units() const;

  const mjModel* model_;
  MoveGroup group_;
  std::vector<int> qpos_;  // qpos address of each actuator's joint; -1: it drives no joint
};

// Base class of controllers whose commands are displacements or velocities: 0 keeps the group as it
// is.
class ChangeController : public ActuatedController {
 public:
  using ActuatedController::ActuatedController;
  void keep(const World& world, std::span<const double> target,
            std::span<double> command) const override;
};

}  // namespace mjsense::tasks::robots
