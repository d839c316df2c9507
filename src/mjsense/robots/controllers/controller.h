// SPDX-License-Identifier: Apache-2.0
#pragma once
// What turns a policy's command into controls. Three periods: a policy gives a command every
// policy_dt, a controller computes controls every ctrl_dt, the physics steps every sim_dt:
//
//   policy   |command                            |command
//   control  |begin |compute |compute |compute   |begin ...
//   physics  |.|.|.|.|.|.|.|.|.|.|.|.|.|.|.|.|
//
// A controller whose controls stay as they are between two commands has no compute, which costs
// nothing. State is per world; functions that take a world touch that world's alone and may run in
// parallel with the others.

#include <memory>
#include <span>
#include <string>

#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"
#include "mjsense/robots/move_group.h"
#include "mjsense/robots/state_row.h"

namespace mjsense {

// The periods of a robot's control, s.
struct ControlPeriods {
  double policy_dt = 0.066;
  double ctrl_dt = 0.002;
};

struct ControllerInit {
  const mjModel* model = nullptr;
  int num_worlds = 1;
  int base_body = -1;
  ControlPeriods periods;
  std::string prefix;  // of the robot's names
  std::string place;   // "robot 'x', move group 'arm'"
};

class Controller {
 public:
  virtual ~Controller() = default;

  // Fills command_size, command_unit, target_size, target_unit of the group.
  virtual void describe(MoveGroup& group) const = 0;

  // The state row of an episode's start was written: controls that keep it.
  virtual void start(const StateRow& state) const = 0;
  // A new episode, in a fresh world.
  virtual void reset(const World& world, std::span<double> target) { hold(world, target); }
  // No command: from here on the group stays as it is in this fresh world. `target`: what it aims
  // at then, as for command().
  virtual void hold(const World& world, std::span<double> target) = 0;
  // The command that leaves the group as it is, or where `target` sends it.
  virtual void keep(const World& world, std::span<const double> target,
                    std::span<double> command) const = 0;
  // A command: as many finite numbers as describe() says. `target` [target_size] (in: the last one)
  // becomes the positions that it aims at, without noise: what actions/joint_pos records.
  virtual void command(const World& world, std::span<const double> command,
                       std::span<double> target) = 0;
  // Noise on a target, of a kind that only the controller knows; the arms' is Robot's.
  virtual void disturb(const World& /*world*/, Rng& /*rng*/, std::span<double> /*target*/) {}
  // A policy step begins, after hold() or command(): controls for its first control step.
  virtual void begin(const World& world, std::span<const double> target, const StateRow& state) = 0;

  // True if controls change between commands: then compute() follows before every other control
  // step, `index` from 1, in the parallel pass over the worlds. Of the world, the state alone (qpos,
  // qvel, mocap) is current. Returns the last of MuJoCo's stages that what it wrote leaves valid:
  // mjSTAGE_VEL after controls, mjSTAGE_NONE after mocap bodies.
  virtual bool every_step() const { return false; }
  virtual mjtStage compute(const World& /*world*/, int /*index*/, const StateRow& /*state*/) {
    return mjSTAGE_ACC;
  }
};

// Of a group's configuration. Throws ValueError where the group is not as its controller needs it.
std::unique_ptr<Controller> make_controller(const ControllerCfg& cfg, const MoveGroup& group,
                                            const ControllerInit& init);

}  // namespace mjsense
