// SPDX-License-Identifier: Apache-2.0
#pragma once
// Grasps of an episode that did not hold, or not to the end: rather another one than the same again.

#include <algorithm>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

class FailedGrasps {
 public:
  void clear() { grasps_.clear(); }
  void add(const Pose& object_tool) { grasps_.push_back(object_tool); }  // X_OT
  // Whether one that failed is the same as X_OT, or nearly. With the fingers the other way round it
  // is the same.
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

}  // namespace mjsense
