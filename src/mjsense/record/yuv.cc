// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/yuv.h"

#include <vector>

#include "mjsense/core/system/cpu.h"

namespace mjsense::record {
namespace {

Yuv420Kernel best_kernel() {
  if constexpr (kHasAvx) {
    if (cpu_isa() == Isa::kAvx512) return yuv420_avx512;
    if (cpu_isa() == Isa::kAvx2) return yuv420_avx2;
  }
  return yuv420_portable;
}

}  // namespace

std::size_t yuv420_bytes(int width, int height) {
  const std::size_t columns = width + width % 2, rows = height + height % 2;
  return columns * rows / 2 * 3;
}

// One row of red, green and blue, then eight rows of both chroma planes.
std::size_t yuv420_scratch(int width) {
  return static_cast<std::size_t>(3 + 8) * (width + width % 2);
}

void encode_yuv420(std::span<const std::uint8_t> rgb, int width, int height,
                   std::span<std::uint8_t> out) {
  static const Yuv420Kernel kernel = best_kernel();
  std::vector<std::int16_t> scratch(yuv420_scratch(width));
  kernel(rgb.data(), width, height, out.data(), scratch.data());
}

}  // namespace mjsense::record
