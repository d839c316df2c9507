// SPDX-License-Identifier: Apache-2.0
#pragma once
// Grasps of an episode that failed, so that a retry takes another one.

#include <algorithm>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::tasks::policies {

class FailedGrasps {
 public:
  void clear() { grasps_.clear(); }
  void add(const Pose& object_tool) { grasps_.push_back(object_tool); }  // X_OT
  // True if X_OT is close to a failed grasp. Grasps that differ by half a turn about the approach
  // (swapped fingers) count as the same.
  bool has(const Pose& object_tool) const {
    const Quat flipped = object_tool.q * Quat{0, 0, 0, 1};
    return std::ranges::any_of(grasps_, [&](const Pose& failed) {
      return norm(failed.p - object_tool.p) < kSame &&
             std::min(angle_between(failed.q, object_tool.q), angle_between(failed.q, flipped)) <
                 kSameTurn;
    });
  }

 private:
  static constexpr double kSame = 0.012, kSameTurn = 0.4;  // m, rad
  std::vector<Pose> grasps_;
};

}  // namespace mjsense::tasks::policies
