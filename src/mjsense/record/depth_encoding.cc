// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/depth_encoding.h"

#include <cmath>

namespace mjsense::record {

void encode_depth16(std::span<const float> metres, double unit, std::span<std::uint16_t> out) {
  const auto scale = static_cast<float>(1.0 / unit);
  for (std::size_t i = 0; i < metres.size(); ++i) {
    // These comparisons can be vectorised. All comparisons with NaN are false, so NaN becomes
    // kDepthInvalid.
    const float units = metres[i] * scale + 0.5f;
    const float low = units >= 1.0f ? units : 1.0f;
    const float in_range = low <= 65535.0f ? low : 65535.0f;
    out[i] = metres[i] > 0.0f ? static_cast<std::uint16_t>(static_cast<std::int32_t>(in_range))
                              : kDepthInvalid;
  }
}

void encode_depth_red_green(std::span<const float> metres, std::span<std::uint8_t> rgb) {
  for (std::size_t i = 0; i < metres.size(); ++i) {
    const float v = metres[i];  // single precision throughout, like NumPy with a float32 image
    const bool inside = v >= 0.05f && v <= 0.55f;
    const auto code = inside ? static_cast<std::uint16_t>((v - 0.05f) / 0.5f * 65534.0f + 1.0f)
                             : std::uint16_t{0};
    rgb[3 * i] = static_cast<std::uint8_t>(code >> 8);
    rgb[3 * i + 1] = static_cast<std::uint8_t>(code & 255);
    rgb[3 * i + 2] = 0;
  }
}

}  // namespace mjsense::record
