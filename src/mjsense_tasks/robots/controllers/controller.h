// SPDX-License-Identifier: Apache-2.0
#pragma once
// Controller interface: turns a policy's commands into controls. There are three periods: a policy
// gives a command every policy_dt, a controller computes controls every ctrl_dt, and the physics
// steps every sim_dt:
//
//   policy   |command                            |command
//   control  |begin |compute |compute |compute   |begin ...
//   physics  |.|.|.|.|.|.|.|.|.|.|.|.|.|.|.|.|
//
// A controller whose controls do not change between two commands has no compute step and no cost
// for it. State is stored per world; functions that take a world access the state of that world
// only and may run in parallel with calls for other worlds.

#include <memory>
#include <span>
#include <string>

#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"
#include "mjsense_tasks/robots/move_group.h"
#include "mjsense_tasks/robots/state_row.h"

namespace mjsense::tasks::robots {

// Periods of the policy and the controllers, s.
struct ControlPeriods {
  double policy_dt = 0.066;
  double ctrl_dt = 0.002;
};

struct ControllerInit {
  const mjModel* model = nullptr;
  int num_worlds = 1;
  int base_body = -1;
  ControlPeriods periods;
  std::string prefix;   // of the robot's names
  std::string context;  // "robot 'x', move group 'arm'"
};

class Controller {
 public:
  virtual ~Controller() = default;

  // Sets command_size, command_unit, command_low, command_high, target_size and target_unit of the
  // group.
  virtual void describe(MoveGroup& group) const = 0;

  // Writes controls that hold the start state, after that has been written to `state`.
  virtual void start(const StateRow& state) const = 0;
  // Starts an episode. The derived fields of the world are current.
  virtual void reset(const World& world, std::span<double> target) { hold(world, target); }
  // The policy gives no command: from now on the group stays as it is in this world, whose derived
  // fields are current. `target` receives the resulting positions, as in command().
  virtual void hold(const World& world, std::span<double> target) = 0;
  // Writes the command that keeps the group as it is or, if it has a target, sends it to `target`.
  virtual void keep(const World& world, std::span<const double> target,
                    std::span<double> command) const = 0;
  // A new command: as many finite numbers as describe() says. `target` [target_size] (in: the last
  // target) receives the new target positions, without noise; `actions/joint_pos` records them.
  virtual void command(const World& world, std::span<const double> command,
                       std::span<double> target) = 0;
  // Adds controller-specific noise to a target. Noise on arms is added by Robot.
  virtual void disturb(const World& /*world*/, Rng& /*rng*/, std::span<double> /*target*/) {}
  // Writes the controls of the first control step of a policy step, after hold() or command().
  virtual void begin(const World& world, std::span<const double> target, const StateRow& state) = 0;

  // True if controls change between commands. Then compute() is called before every later control
  // step (`index` 1, 2, ...) in the parallel pass over the worlds. Only the state (qpos, qvel,
  // mocap) of the world is current then. Returns the last of MuJoCo's stages that remains valid
  // after the write: mjSTAGE_VEL after controls, mjSTAGE_NONE after mocap bodies.
  virtual bool every_step() const { return false; }
  virtual mjtStage compute(const World& /*world*/, int /*index*/, const StateRow& /*state*/) {
    return mjSTAGE_ACC;
  }
};

// Makes the controller of a group. Throws ValueError if the group does not meet its requirements.
std::unique_ptr<Controller> make_controller(const ControllerCfg& cfg, const MoveGroup& group,
                                            const ControllerInit& init);

}  // namespace mjsense::tasks::robots
