// SPDX-License-Identifier: Apache-2.0
#pragma once
// Encodings of depth in 16 bits. mjsense's encoding is linear and exact to half a unit over the
// whole range. MolmoSpaces' encoding stores 0.05 to 0.55 m in the red and green bytes of an RGB
// image.

#include <cstdint>
#include <span>

namespace mjsense::record {

constexpr std::uint16_t kDepthInvalid = 0;  // no measurement: NaN, 0 or negative
constexpr std::uint16_t kDepthFar = 65535;  // at or beyond the maximum range, infinity included

// out = round(metres / unit), clamped to 1 .. 65535.
void encode_depth16(std::span<const float> metres, double unit, std::span<std::uint16_t> out);

// For v in [0.05, 0.55]: code = trunc((v - 0.05) / 0.5 * 65534 + 1), otherwise 0. Red is the high
// byte, green the low byte, and blue is 0.
void encode_depth_red_green(std::span<const float> metres, std::span<std::uint8_t> rgb);

}  // namespace mjsense::record
