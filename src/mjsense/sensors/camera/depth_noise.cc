// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/depth_noise.h"

#include <algorithm>
#include <cmath>

namespace mjsense::sensors {
namespace {

constexpr double kSubpixels = 32;  // Intel's matcher has 5 fractional bits
constexpr double kJump = 0.04;  // relative deviation of depth from a plane that counts as an edge

// Change of depth along one axis. `before` and `after` are the neighbours' true depths, negative
// outside the image, and 0 where nothing is seen.
struct Run {
  bool jump;
  double change;  // of depth from pixel to pixel, on this side of a jump
};

// 1 / z is linear along a plane, however steep it is. Any deviation from that is an edge.
Run run_of(double before, double z, double after) {
  const auto far = [](double depth) { return depth > 0 ? 1 / depth : 0; };
  if (before < 0 && after < 0) return {false, 0};
  if (before < 0 || after < 0) {
    const double other = std::max(before, after);
    return {other == 0, std::abs(other - z)};
  }
  return {std::abs(far(before) + far(after) - 2 / z) > kJump / z,
          std::min(std::abs(before - z), std::abs(after - z))};
}

}  // namespace

StereoCamera stereo_preset(DepthNoise noise) {
  // Baselines and ranges of the data sheets; 0.08 pixels of disparity noise give their accuracy
  // figures (2% at 2 m and 0.5 m with margin).
  if (noise == DepthNoise::kD405) return {0.018, 848, 0.08, 0.07, 2.0, 0.5, 0.7, 6};
  return {0.050, 848, 0.08, 0.195, 10.0, 0.5, 0.7, 6};
}

void add_stereo_noise(const StereoCamera& camera, std::span<float> depth, int width, double fx,
                      Rng rng, std::span<float> scratch) {
  std::copy(depth.begin(), depth.end(), scratch.begin());
  const int height = static_cast<int>(depth.size()) / width;
  const double focal = fx * camera.native_width / width;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t i = static_cast<std::size_t>(y) * width + x;
      const double z = scratch[i];
      // Every pixel draws its numbers, whatever it sees, so that its noise does not depend on other
      // pixels.
      const double noise = rng.normal(), luck = rng.uniform();
      if (!(z > 0)) {
        depth[i] = 0;
        continue;
      }
      const auto at = [&](bool inside, std::size_t j) -> double {
        return inside ? scratch[j] : -1;
      };
      const Run across = run_of(at(x > 0, i - 1), z, at(x + 1 < width, i + 1));
      const Run down = run_of(at(y > 0, i - width), z, at(y + 1 < height, i + width));
      const double slope = std::hypot(across.change, down.change) * fx / z;
      const double loss = across.jump || down.jump       ? camera.edge_loss
                          : slope > camera.grazing_slope ? camera.grazing_loss
                                                         : 0;
      double disparity = focal * camera.baseline / z + camera.sigma * noise;
      disparity = std::max(std::round(disparity * kSubpixels), 1.0) / kSubpixels;
      const double measured = focal * camera.baseline / disparity;
      const bool lost = luck < loss || measured < camera.nearest || measured > camera.farthest;
      depth[i] = lost ? 0.0f : static_cast<float>(measured);
    }
  }
}

}  // namespace mjsense::sensors
