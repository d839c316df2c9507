// SPDX-License-Identifier: Apache-2.0
#pragma once
// Model values that belong to one episode: sizes, masses, lights, textures that are drawn at its
// start.

#include <mujoco/mujoco.h>

#include <vector>

#include "mjsense/record/recording.h"

namespace mjsense::record {

// Copies of the arrays of `world` that differ from those of `scene`, with mjModel's names and
// shapes. Numbers of floating point that are equal in both are NaN, so that a large array with few
// changes compresses well. Both models have the same sizes.
std::vector<EpisodeArray> differing_fields(const mjModel& world, const mjModel& scene);

}  // namespace mjsense::record
