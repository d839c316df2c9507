// SPDX-License-Identifier: Apache-2.0
#pragma once
// Interface of policies, which choose the robot's next command. Implement reset() and act() for one
// world, which run in parallel, or reset_all() and act_all() for all worlds at once. Code that runs
// episodes calls only the latter, once per step.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"
#include "mjsense_tasks/episode/active_worlds.h"
#include "mjsense_tasks/robots/action.h"

namespace mjsense::sim {
class Simulation;
}  // namespace mjsense::sim

namespace mjsense::tasks::episode {

class Task;

struct Phase {
  std::string_view name;
  int number;
};

// A part of a planned motion: the way of one tool.
struct PlannedPath {
  std::string_view phase;
  std::vector<Pose> poses;  // X_WT
};

class Policy {
 public:
  virtual ~Policy() = default;
  virtual std::string_view name() const = 0;

  // The simulation in which the policy acts. Called before initialize(), if there is a simulation.
  virtual void bind(const std::shared_ptr<sim::Simulation>& /*simulation*/) {}
  // Called once, by Task::register_policy(). Allocates memory for the task's worlds.
  virtual void initialize(Task& task) = 0;
  // Starts an episode; the world's data is current. Must not throw for a task that the policy
  // cannot solve: the first action gives up instead.
  virtual void reset(const World& /*world*/) {}
  // The action for the next control step. Must access this world's state only, because worlds act
  // in parallel.
  virtual void act(const World& world, robots::Action& action);

  // For all active worlds at once, on the caller's thread. `actions` has a row for every world of
  // the simulation; the rows of the active worlds are empty and must be filled.
  virtual void reset_all(ActiveWorlds& worlds);
  virtual void act_all(ActiveWorlds& worlds, std::span<robots::Action> actions);

  // All phases, for policy_phases of obs_scene; empty if the policy has none.
  virtual std::span<const Phase> phases() const { return {}; }
  // Further members of obs_scene with text values, in this order, such as the network and its
  // training step.
  virtual std::vector<std::pair<std::string, std::string>> info(int /*world*/) const { return {}; }
  // Why the policy gave up, or why it last started again, in a few words. The same reason always
  // has the same words. "" if it did neither, or if the reason is unknown.
  virtual std::string failure(int /*world*/) const { return ""; }
  // The motion that the policy has planned in this world, for viewers. Empty: it has no plan.
  virtual std::vector<PlannedPath> planned_paths(const World& /*world*/) const { return {}; }
  // Sensors that this policy adds to the suite. They refer to this policy.
  virtual std::vector<std::shared_ptr<Sensor>> create_policy_sensors() const { return {}; }
};

// A policy with phases. The sensors policy_phase, policy_num_retries and grasp_pose record its
// state.
class PlannerPolicy : public Policy {
 public:
  virtual int phase(int world) const = 0;  // number of the current phase
  virtual int num_retries(int world) const = 0;
  // X_WT, target of the tool; the identity before the first plan with a grasp.
  virtual Pose grasp_pose(int world) const = 0;
  virtual bool has_grasp_pose() const { return true; }

  std::vector<std::shared_ptr<Sensor>> create_policy_sensors() const override;
};

}  // namespace mjsense::tasks::episode
