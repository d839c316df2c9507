// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/light/environment_light.h"

#include <algorithm>
#include <cmath>

namespace mjsense::render {
namespace {
float sky(const float d[3], float blur) {
  const float w = 0.15f + blur;
  const float up = std::clamp(0.5f + 0.5f * d[2] / w, 0.0f, 1.0f);
  const float lamp = std::exp(-(1 - d[2]) * 6 / (0.3f + blur));
  return 0.45f + 0.55f * up + 1.2f * lamp;
}
std::uint32_t pack(float x) {
  int e = std::max(-15, static_cast<int>(std::floor(std::log2(std::max(x, 1e-9f)))) + 1);
  std::uint32_t m = static_cast<std::uint32_t>(std::lround(x / std::exp2(e - 9)));
  if (m > 511) {
    ++e;
    m = static_cast<std::uint32_t>(std::lround(x / std::exp2(e - 9)));
  }
  return m | m << 9 | m << 18 | static_cast<std::uint32_t>(e + 15) << 27;
}
}  // namespace

std::shared_ptr<const Environment> environment(const mjModel*, const std::string& what) {
  auto out = std::make_shared<Environment>();
  const bool white = what == "white";
  for (int i = 0; i < 9; ++i)
    for (float& x : out->light.irradiance[i]) x = i == 0 ? 1.0f : i == 2 && !white ? 0.3f : 0.0f;
  Texture& t = out->light.radiance;
  t.cube = true;
  t.levels = 9;
  int at = 0;
  const int sizes[] = {128, 64, 32, 32, 16, 16, 16, 16, 16};
  for (int l = 0; l < 9; ++l) {
    const int n = sizes[l];
    t.width[l] = t.height[l] = static_cast<float>(n);
    t.offset[l] = at;
    at += 6 * n * (n + 1);
    for (int f = 0; f < 6; ++f)
      for (int y = 0; y < n; ++y)
        for (int x = 0; x <= n; ++x) {
          const float s = -1 + 2.0f * std::min(x, n - 1) / (n - 1), v = -1 + 2.0f * y / (n - 1);
          const float all[6][3] = {{1, -v, -s}, {-1, -v, s}, {s, 1, v},
                                   {s, -1, -v}, {s, -v, 1},  {-s, -v, -1}};
          const float* d = all[f];
          const float r = 1 / std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
          const float u[3] = {d[0] * r, d[1] * r, d[2] * r};
          out->texels.push_back(pack(white ? 1 : sky(u, static_cast<float>(l) / 8)));
        }
  }
  t.texels = out->texels.data();
  return out;
}

}  // namespace mjsense::render
