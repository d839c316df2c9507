// SPDX-License-Identifier: Apache-2.0
#pragma once
// What goes wrong on purpose in some episodes, so that recordings show how it is mended: the object is shoved aside
// while the hand comes, or the hand opens for a moment while it holds it.

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
  // Before control step `step` (from 0): may write the velocity of body `object`, which has a free joint,
  // and the commands of grippers. Once an episode.
  void apply(const World& world, const Robot& robot, int object, int step, Action& action,
             const StateRow& state);
  Kind kind() const { return kind_; }
  bool happened() const { return happened_at_ >= 0; }

 private:
  Kind kind_ = Kind::kNone;
  int wait_ = 0;  // steps: a shove's from the start, a slip's since the object was lifted
  int held_ = 0;
  double direction_ = 0, speed_ = 0;
  std::optional<double> rest_height_;  // m, of the object when the episode began
  int happened_at_ = -1;
};

}  // namespace mjsense
