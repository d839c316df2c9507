// SPDX-License-Identifier: Apache-2.0
#pragma once
// A policy: what to command next. Write reset() and act() for one world, which run in parallel, or
// reset_all() and act_all() for all of them at once; whoever plays episodes calls the latter alone,
// once a step.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"
#include "mjsense/episode/active_worlds.h"
#include "mjsense/robots/action.h"

namespace mjsense {

class Simulation;
class Task;

struct Phase {
  std::string_view name;
  int number;
};

class Policy {
 public:
  virtual ~Policy() = default;
  virtual std::string_view name() const = 0;

  // The worlds in which it acts. Called before initialize(), by those who have a simulation.
  virtual void bind(const std::shared_ptr<Simulation>& /*simulation*/) {}
  // Called once by Task::register_policy: allocates for the task's worlds.
  virtual void initialize(Task& task) = 0;
  // A new episode of a fresh world. Throws nothing for a task that it cannot solve: the first
  // action gives up.
  virtual void reset(const World& /*world*/) {}
  // The action for the next control step. Touches this world's state alone: worlds act in parallel.
  virtual void act(const World& world, Action& action);

  // All worlds at once, on the caller's thread. `actions` has a row for every world there is; those
  // of the active ones are empty and wait to be filled.
  virtual void reset_all(ActiveWorlds& worlds);
  virtual void act_all(ActiveWorlds& worlds, std::span<Action> actions);

  // Every phase there is: obs_scene's policy_phases. Empty: it knows none.
  virtual std::span<const Phase> phases() const { return {}; }
  // Further members of obs_scene with text values, in this order: which network, of which step.
  virtual std::vector<std::pair<std::string, std::string>> info(int /*world*/) const { return {}; }
  // Why it gave up, or began again last, in a few words that are the same for the same reason; "" if
  // it never did, or does not say.
  virtual std::string failure(int /*world*/) const { return ""; }
  // Sensors that this policy adds to the suite. They refer to this policy.
  virtual std::vector<std::shared_ptr<Sensor>> create_policy_sensors() const { return {}; }
};

// A policy that follows phases: its state is what policy_phase, policy_num_retries and grasp_pose
// record.
class PlannerPolicy : public Policy {
 public:
  virtual int phase(int world) const = 0;  // number of the present one
  virtual int num_retries(int world) const = 0;
  // X_WT, target of the tool; the identity before the first plan with a grasp.
  virtual Pose grasp_pose(int world) const = 0;
  virtual bool has_grasp_pose() const { return true; }

  std::vector<std::shared_ptr<Sensor>> create_policy_sensors() const override;
};

}  // namespace mjsense
