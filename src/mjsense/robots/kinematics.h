// SPDX-License-Identifier: Apache-2.0
#pragma once
// Forward and inverse kinematics of a chain of a compiled model, from its fixed transforms alone:
// no mjData, so that any thread may plan for any world.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/robots/link.h"

namespace mjsense {

// Hinges and slides from body `base` (excluded) to site `leaf`; J = joints().size() of them move.
class Chain {
 public:
  static constexpr int kMaxJoints = 32;
  static constexpr int kTracking = 100;  // iterations of ik() that stay with its start

  // Joints that `moving` does not list stay at the model's qpos0.
  Chain(const mjModel* model, int base_body, int leaf_site, std::span<const int> moving);

  std::span<const int> joints() const { return joints_; }  // ids, base to leaf
  std::span<const double> low() const { return low_; }     // joint ranges; infinite where unlimited
  std::span<const double> high() const { return high_; }

  // Pose of the leaf in the base frame.
  Pose fk(std::span<const double> q) const;
  // Also the Jacobian [6, J], row-major: rows v (m per unit of q), then w (rad per unit of q), base
  // axes, at the leaf.
  Pose jacobian(std::span<const double> q, std::span<double> jacobian) const;

  // The smallest joint motion dq that moves the leaf by `twist` (base axes, at the leaf): J^+
  // twist. Near a singular configuration it is damped, dq = J^T (J J^T + d^2 I)^-1 twist, and moves
  // the leaf by less: d^2 = d_max^2 (1 - (s / s_0)^2) where the gain s = |twist| / |J^+ twist| is
  // below s_0 (numerical filtering after Maciejewski and Klein). So |dq| stays below 15 |twist|.
  // `moves` [J]: which joints may move (dq of the others is 0); all if it is empty.
  void joint_motion(std::span<const double> q, const Twist& twist, std::span<double> dq,
                    std::span<const bool> moves = {}) const;

  // Moves q (in: the start, out: the solution) until the leaf is at `target` (base frame): dq = J^T
  // (J J^T + 1e-12 I)^-1 e with e = log6(T^-1 T*) in base axes, clipped to the joint ranges in
  // every iteration. True if |e| < tolerance within max_iterations; q is otherwise the last
  // iterate. The first kTracking iterations start at q, so that a solution near q is found where
  // there is one; if they end in a corner of the ranges, the others begin anew where, of
  // configurations spread over them, the leaf is nearest to the target. `moves` [J]: which joints may
  // move; all where it is empty.
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

}  // namespace mjsense
