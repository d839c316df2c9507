// SPDX-License-Identifier: Apache-2.0
#include "mjsense/episode/perturbation.h"

#include <cmath>
#include <numbers>

namespace mjsense {
namespace {

constexpr int kShoveFirst = 5, kShoveSteps = 20;  // control steps
constexpr double kSlow = 0.5, kFast = 0.8;        // m/s of a shove
constexpr int kSlipSteps = 12;                    // after it was lifted
constexpr int kOpenSteps = 6;                     // that the hand is open
constexpr double kLifted = 0.01;                  // m

}  // namespace

void Perturbation::begin(double share, std::uint64_t seed, std::int64_t episode) {
  *this = {};
  if (share <= 0) return;
  Rng rng(seed, 0, stream_of("episode/perturbation"), static_cast<std::uint64_t>(episode));
  if (rng.uniform() >= share) return;
  kind_ = rng.below(2) == 0 ? Kind::kShove : Kind::kSlip;
  wait_ = kind_ == Kind::kShove ? kShoveFirst + static_cast<int>(rng.below(kShoveSteps))
                                : static_cast<int>(rng.below(kSlipSteps));
  direction_ = rng.uniform(-std::numbers::pi, std::numbers::pi);
  speed_ = rng.uniform(kSlow, kFast);
}

void Perturbation::apply(const World& world, const Robot& robot, int object, int step,
                         Action& action, const StateRow& state) {
  if (kind_ == Kind::kNone || object < 0) return;
  const mjModel* m = world.model;
  const int joint = m->body_jntadr[object];
  if (joint < 0 || m->jnt_type[joint] != mjJNT_FREE) return;
  const double height = world.data->xpos[3 * object + 2];
  if (!rest_height_) rest_height_ = height;
  const bool lifted = height > *rest_height_ + kLifted;
  if (kind_ == Kind::kShove) {
    // One that is held by now stays.
    if (happened() || lifted || step != wait_) return;
    double* v = state.qvel + m->jnt_dofadr[joint];
    v[0] += speed_ * std::cos(direction_);
    v[1] += speed_ * std::sin(direction_);
    happened_at_ = step;
    return;
  }
  if (!happened()) {
    if (!lifted || held_++ < wait_) return;
    happened_at_ = step;
  }
  if (step >= happened_at_ + kOpenSteps) return;
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const MoveGroup& group = robot.groups()[g];
    if (group.kind == GroupKind::kGripper && action.commands[g].given)
      action.commands[g].set({&group.open_command, 1});
  }
}

}  // namespace mjsense
