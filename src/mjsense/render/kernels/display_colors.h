// SPDX-License-Identifier: Apache-2.0
#pragma once
// Tone mapping of images that the kernels have not mapped: path-traced ones, and those of an image sensor.

#include <span>

#include "mjsense/render/view/physical_view.h"

namespace mjsense::render {

// From linear radiance [pixels, 3] to the colours of a display, 0..1, in place.
void map_to_display(const PhysicalView& view, std::span<float> rgb);

}  // namespace mjsense::render
