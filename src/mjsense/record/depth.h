// SPDX-License-Identifier: Apache-2.0
#pragma once
// Depth as 16 bits: ours, linear and exact to half a unit over the whole range; and MolmoSpaces',
// 0.05 to 0.55 m in the red and green bytes of a picture.

#include <cstdint>
#include <span>

namespace mjsense {

constexpr std::uint16_t kDepthInvalid = 0;  // no measurement: NaN, zero, negative
constexpr std::uint16_t kDepthFar = 65535;  // that far or farther, infinity included

// out = round(metres / unit), clamped to 1 .. 65535.
void encode_depth16(std::span<const float> metres, double unit, std::span<std::uint16_t> out);

// v in [0.05, 0.55]: trunc((v - 0.05) / 0.5 * 65534 + 1), else 0; red the high byte, green the low
// one, blue 0.
void encode_depth_red_green(std::span<const float> metres, std::span<std::uint8_t> rgb);

}  // namespace mjsense
