// SPDX-License-Identifier: Apache-2.0
#pragma once
// Deliberate perturbations of some episodes, so that recordings show how a policy recovers. The
// object is shoved aside while the gripper approaches, or the gripper opens for a moment while it
// holds the object. With an articulated object (a drawer, or a door with a handle) the gripper
// always slips.

#include <cstdint>
#include <optional>

#include "mjsense/core/sensor.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::episode {

// The perturbation of one world.
class Perturbation {
 public:
  enum class Kind { kNone, kShove, kSlip };

  // Starts an episode. A share `share` of them is perturbed; which ones and how is a function of
  // (seed, episode).
  void begin(double share, std::uint64_t seed, std::int64_t episode);
  // Call before control step `step` (from 0). May write the velocity of body `object`, if it has a
  // free joint, and the commands of grippers. Perturbs once per episode, and never if no joint
  // moves the object.
  void apply(const World& world, const robots::Robot& robot, int object, int step,
             robots::Action& action, const robots::StateRow& state);
  Kind kind() const { return kind_; }
  bool happened() const { return happened_at_ >= 0; }

 private:
  static int joint_of(const mjModel* model, int object);
  static double progress(const World& world, int joint);
  void push(const World& world, int joint, const robots::StateRow& state) const;

  Kind kind_ = Kind::kNone;
  // Control steps: of a shove from the start, of a slip from when the gripper has moved the object.
  int wait_ = 0;
  int held_ = 0;
  double direction_ = 0, speed_ = 0;
  std::optional<double> rest_;  // progress() at the start of the episode
  int happened_at_ = -1;
};

}  // namespace mjsense::tasks::episode
