// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/perturbation.h"

#include <cmath>
#include <numbers>

namespace mjsense::tasks::episode {
namespace {

// Control steps: the first one in which the object can be shoved, and the number of such steps.
constexpr int kShoveFirst = 5, kShoveSteps = 20;
constexpr double kSlow = 0.5, kFast = 0.8;  // m/s, speed of a shove
// Control steps: upper bound of the wait of a slip, after the gripper has moved the object.
constexpr int kSlipSteps = 12;
constexpr int kOpenSteps = 6;     // control steps in which the gripper is open
constexpr double kLifted = 0.01;  // m; a free object that is lifted higher is held
// Share of the joint's range; an articulated object that is moved further is held.
constexpr double kAjar = 0.03;

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

// The joint that moves when the gripper moves the object. It is the object's own joint or, for a
// lever, that of the leaf that carries it.
int Perturbation::joint_of(const mjModel* m, int object) {
  int joint = -1;
  for (int body = object; body > 0; body = m->body_parentid[body]) {
    if (m->body_jntnum[body] == 0 && joint >= 0) break;
    if (m->body_jntnum[body] == 0) continue;
    const bool is_free = m->jnt_type[m->body_jntadr[body]] == mjJNT_FREE;
    if (joint < 0 || !is_free) joint = m->body_jntadr[body];
    if (is_free) break;
  }
  return joint;
}

// How far the object has been moved: the height of a free object in m, otherwise the joint position
// as a share of its range.
double Perturbation::progress(const World& world, int joint) {
  const mjModel* m = world.model;
  if (m->jnt_type[joint] == mjJNT_FREE) return world.data->xpos[3 * m->jnt_bodyid[joint] + 2];
  const double* range = m->jnt_range + 2 * joint;
  const bool limited = m->jnt_limited[joint] && range[1] > range[0];
  return world.data->qpos[m->jnt_qposadr[joint]] / (limited ? range[1] - range[0] : 1);
}

void Perturbation::push(const World& world, int joint, const robots::StateRow& state) const {
  double* v = state.qvel + world.model->jnt_dofadr[joint];
  v[0] += speed_ * std::cos(direction_);
  v[1] += speed_ * std::sin(direction_);
}

void Perturbation::apply(const World& world, const robots::Robot& robot, int object, int step,
                         robots::Action& action, const robots::StateRow& state) {
  if (kind_ == Kind::kNone || object < 0) return;
  const mjModel* m = world.model;
  const int joint = joint_of(m, object);
  if (joint < 0 || m->jnt_type[joint] == mjJNT_BALL) return;
  const bool is_free = m->jnt_type[joint] == mjJNT_FREE;
  const double now = progress(world, joint);
  if (!rest_) rest_ = now;
  const bool held = is_free ? now > *rest_ + kLifted : std::abs(now - *rest_) > kAjar;
  if (is_free && kind_ == Kind::kShove) {
    // An object that is already held is not shoved.
    if (happened() || held || step != wait_) return;
    push(world, joint, state);
    happened_at_ = step;
    return;
  }
  if (!happened()) {
    if (!held || held_++ < wait_) return;
    happened_at_ = step;
  }
  if (step >= happened_at_ + kOpenSteps) return;
  for (std::size_t g = 0; g < robot.groups().size(); ++g) {
    const robots::MoveGroup& group = robot.groups()[g];
    if (group.kind == robots::GroupKind::kGripper && action.commands[g].given)
      action.commands[g].set({&group.open_command, 1});
  }
}

}  // namespace mjsense::tasks::episode
