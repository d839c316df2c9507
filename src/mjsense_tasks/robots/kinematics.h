// SPDX-License-Identifier: Apache-2.0
#pragma once
// Forward and inverse kinematics of a kinematic chain of a compiled model. It uses the model's
// fixed transforms only, no mjData, so any thread may plan for any world.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/robots/link.h"

namespace mjsense::tasks::robots {

// The hinge and slide joints from body `base` (excluded) to site `leaf`; J = joints().size().
class Chain {
 public:
  static constexpr int kMaxJoints = 32;
  // the first iterations of ik(), before it restarts elsewhere
  static constexpr int kTracking = 100;

  // `moving`: ids of the joints that belong to the chain; all others stay at the model's qpos0.
  Chain(const mjModel* model, int base_body, int leaf_site, std::span<const int> moving);

  std::span<const int> joints() const { return joints_; }  // ids, base to leaf
  std::span<const double> low() const { return low_; }     // joint ranges; infinite where unlimited
  std::span<const double> high() const { return high_; }

  // Pose of the leaf, base frame. q [J].
  Pose fk(std::span<const double> q) const;
  // Also writes the Jacobian [6, J], row-major, at the leaf, base axes: three rows v (m per unit of
  // q), then three rows w (rad per unit of q).
  Pose jacobian(std::span<const double> q, std::span<double> jacobian) const;

  // The smallest joint motion dq that moves the leaf by `twist` (base axes, at the leaf): J^+
  // twist. Near a singular configuration it is damped, dq = J^T (J J^T + d^2 I)^-1 twist, and moves
  // the leaf by less than `twist`. Damping begins when the gain s = |twist| / |J^+ twist| is below
  // s_0: d^2 = d_max^2 (1 - (s / s_0)^2) (numerical filtering after Maciejewski and Klein). The
  // result satisfies |dq| < 15 |twist|. `moves` [J]: which joints may move (dq of the others is 0);
  // empty: all.
  void joint_motion(std::span<const double> q, const Twist& twist, std::span<double> dq,
                    std::span<const bool> moves = {}) const;

  // Changes q (in: the start, out: the solution) until the leaf is at `target` (base frame). Each
  // iteration adds dq = J^T (J J^T + 1e-12 I)^-1 e with e = log6(T^-1 T*) in base axes, and clips q
  // to the joint ranges. Returns true if |e| < tolerance within max_iterations; otherwise q is the
  // last iterate. The first kTracking iterations start at q and find a solution near q if there is
  // one. If they get stuck at joint limits, the remaining iterations restart from other
  // configurations: of several that are spread over the joint ranges, the one whose leaf is nearest
  // to the target. `moves` [J]: which joints may move; empty: all.
  bool ik(const Pose& target, std::span<double> q, int max_iterations = 1000,
          double tolerance = 1e-4, std::span<const bool> moves = {}) const;

 private:
  void spread(int k, std::span<double> q, std::span<const bool> moves) const;
  void restart(const Pose& target, int attempt, std::span<double> q,
               std::span<const bool> moves) const;

  std::vector<Link> links_;
  Pose tail_;  // from the last link to the leaf
  std::vector<int> joints_;
  std::vector<double> low_, high_;
};

}  // namespace mjsense::tasks::robots
