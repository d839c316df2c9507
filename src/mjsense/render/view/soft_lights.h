// SPDX-License-Identifier: Apache-2.0
#pragma once
// Soft shadows: a light with a radius is drawn as several lights within the ball of that radius,
// which share its colour.

#include "mjsense/render/view/appearance.h"

namespace mjsense::render {

// Number of lights that a view draws instead of light `index`: at most `samples`, and fewer if all
// lights of the view together would exceed kMaxLights. 1 for lights without a position, a
// radius or shadows.
int light_samples(const Appearance& appearance, std::size_t index, int samples);

// Position of sample k of `count` in the ball; a low-discrepancy set. World frame, m.
void sample_position(const double center[3], float radius, int k, int count, double out[3]);

}  // namespace mjsense::render
