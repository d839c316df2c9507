// SPDX-License-Identifier: Apache-2.0
#pragma once
// What goes wrong on purpose in some episodes, so that recordings show how it is mended: the object is shoved aside
// while the hand comes, or the hand opens for a moment while it holds it. From what opens - a drawer, a
// door by its handle - the hand always slips.

#include <cstdint>
#include <optional>

#include "mjsense/core/sensor.h"
#include "mjsense/robots/robot.h"

namespace mjsense {

// Of one world.
class Perturbation {
 public:
  enum class Kind { kNone, kShove, kSlip };

  // A new episode: `share` of them are perturbed, which and how is a function of (seed, episode).
  void begin(double share, std::uint64_t seed, std::int64_t episode);
  // Before control step `step` (from 0): may write the velocity of body `object`, if it has a free joint,
  // and the commands of grippers. Once an episode; never with an object that nothing moves.
  void apply(const World& world, const Robot& robot, int object, int step, Action& action,
             const StateRow& state);
  Kind kind() const { return kind_; }
  bool happened() const { return happened_at_ >= 0; }

 private:
  static int joint_of(const mjModel* model, int object);
  static double progress(const World& world, int joint);
  void shove(const World& world, int joint, const StateRow& state) const;

  Kind kind_ = Kind::kNone;
  int wait_ = 0;  // steps: a shove's from the start, a slip's since the hand moves the object
  int held_ = 0;
  double direction_ = 0, speed_ = 0;
  std::optional<double> rest_;  // progress() when the episode began
  int happened_at_ = -1;
};

}  // namespace mjsense
