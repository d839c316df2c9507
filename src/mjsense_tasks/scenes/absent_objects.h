// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where the objects are that are absent from an episode.

#include "mjsense/core/pose.h"

namespace mjsense::tasks::scenes {

inline constexpr double kAway = 100;  // m, x and y of absent objects
// Pose of an absent object: out of sight, one metre from other absent objects.
inline Pose away(int object) { return {{kAway + object, kAway, 0.5}, {}}; }

}  // namespace mjsense::tasks::scenes
