// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/image_histogram.h"

#include <algorithm>

namespace mjsense::record {

int ImageHistogram::step(int width, int height) {
  constexpr int kMaxSide = 160;
  return (std::max(width, height) + kMaxSide - 1) / kMaxSide;
}

void ImageHistogram::add(std::span<const std::uint8_t> rgb, int width, int height) {
  const int step = ImageHistogram::step(width, height);
  std::uint64_t* const red = counts_.data();
  std::uint64_t* const green = red + kLevels;
  std::uint64_t* const blue = green + kLevels;
  for (int y = 0; y < height; y += step) {
    const std::uint8_t* pixel = rgb.data() + std::size_t{kChannels} * width * y;
    for (int x = 0; x < width; x += step, pixel += std::ptrdiff_t{kChannels} * step) {
      ++red[pixel[0]];
      ++green[pixel[1]];
      ++blue[pixel[2]];
    }
  }
}

}  // namespace mjsense::record
