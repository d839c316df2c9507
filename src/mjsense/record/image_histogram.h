// SPDX-License-Identifier: Apache-2.0
#pragma once
// Counts of the levels of the images of a video, from which exports compute mean, standard deviation
// and quantiles over all frames without decoding the video.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace mjsense::record {

class ImageHistogram {
 public:
  static constexpr int kChannels = 3, kLevels = 256;

  // Distance of the rows and columns that are counted, from row 0 and column 0 on: the smallest with
  // which the longer side has at most 160 of them. That takes 10 us of an image of 640x368.
  static int step(int width, int height);

  // Adds the image uint8 [height, width, 3].
  void add(std::span<const std::uint8_t> rgb, int width, int height);

  // [kChannels, kLevels]
  [[nodiscard]] std::span<const std::uint64_t> counts() const { return counts_; }

 private:
  std::array<std::uint64_t, std::size_t{kChannels} * kLevels> counts_{};
};

}  // namespace mjsense::record
