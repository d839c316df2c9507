#include "mjsense/sensors/camera/depth_noise.h"

#include <algorithm>
#include <cmath>

namespace mjsense {
namespace {

constexpr double kSubpixels = 32;  // Intel's matcher: 5 fractional bits
constexpr double kJump = 0.04;     // relative change of depth from pixel to pixel that is an edge

}  // namespace

StereoCamera stereo_preset(std::string_view name) {
  // Baselines and ranges of the data sheets; 0.08 pixels of disparity noise give their accuracy figures (2% at 2 m and
  // 0.5 m with margin).
  if (name == "d405") return {0.018, 848, 0.08, 0.07, 2.0, 0.5, 0.7, 6};
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
      // The same draws whatever is seen: a pixel's noise does not depend on its neighbours' fate.
      const double noise = rng.normal(), luck = rng.uniform();
      if (z < camera.nearest || z > camera.farthest) {
        depth[i] = 0;
        continue;
      }
      double change = 0;
      const auto compare = [&](bool inside, std::size_t j) {
        if (inside) change = std::max(change, std::abs(scratch[j] - z));
      };
      compare(x > 0, i - 1);
      compare(x + 1 < width, i + 1);
      compare(y > 0, i - width);
      compare(y + 1 < height, i + width);
      const double loss = change > kJump * z                       ? camera.edge_loss
                          : change > camera.grazing_slope * z / fx ? camera.grazing_loss
                                                                   : 0;
      if (luck < loss) {
        depth[i] = 0;
        continue;
      }
      double disparity = focal * camera.baseline / z + camera.sigma * noise;
      disparity = std::max(std::round(disparity * kSubpixels), 1.0) / kSubpixels;
      depth[i] = static_cast<float>(focal * camera.baseline / disparity);
    }
  }
}

}  // namespace mjsense
