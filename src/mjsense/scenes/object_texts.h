// SPDX-License-Identifier: Apache-2.0
#pragma once
// What people call an object of a scene.

#include <vector>

#include "mjsense/episode/task.h"
#include "mjsense/scenes/episode_scene.h"

namespace mjsense {

// The usual name half of the time, the others less and less often.
std::vector<Referral> referrals_of(const SceneObject& object);

}  // namespace mjsense
