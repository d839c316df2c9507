// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/kernels/display_colors.h"

#include <algorithm>
#include <cstddef>

#include "mjsense/render/kernels/tone_mapping.h"

namespace mjsense::render {

void map_to_display(const PhysicalView& view, std::span<float> rgb) {
  const std::size_t pixels = rgb.size() / 3;
  for (std::size_t first = 0; first < pixels; first += kLanes) {
    const std::size_t count = std::min<std::size_t>(kLanes, pixels - first);
    Colors colors = {};
    float* at = rgb.data() + 3 * first;
    for (std::size_t i = 0; i < count; ++i)
      for (int c = 0; c < 3; ++c) colors.rgb[c][i] = at[3 * i + c];
    map_tones(view, colors);
    for (std::size_t i = 0; i < count; ++i)
      for (int c = 0; c < 3; ++c) at[3 * i + c] = colors.rgb[c][i];
  }
}

}  // namespace mjsense::render
