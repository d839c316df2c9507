// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/frustum.h"

#include <algorithm>
#include <cmath>

#include "mjsense/rays/box_list.h"

namespace mjsense::render {
namespace {

// Tolerance relative to lengths and positions, for the rounding of rays and intersection tests.
constexpr double kRelativeSlack = 1e-4;

bool misses(const rays::KernelBoxes& boxes, int k, const Frustum& frustum) {
  const float low[3] = {boxes.low[0][k], boxes.low[1][k], boxes.low[2][k]};
  const float high[3] = {boxes.high[0][k], boxes.high[1][k], boxes.high[2][k]};
  return frustum.misses(low, high);
}

}  // namespace

Frustum::Frustum(const PixelGrid& grid, const double position[3], const double rotation[9]) {
  const double x[2] = {grid.left, grid.left + static_cast<double>(grid.dx) * grid.width};
  const double y[2] = {grid.top, grid.top + static_cast<double>(grid.dy) * grid.height};
  const auto [left, right] = std::minmax(x[0], x[1]);
  const auto [low, high] = std::minmax(y[0], y[1]);
  // Planes in the camera's frame, where z points backwards: X <= right for an orthographic camera,
  // else X <= right (-Z); likewise for the other sides.
  const double bounds[4] = {right, -left, high, -low};
  for (int s = 0; s < 5; ++s) {
    double n[3] = {0, 0, 0}, offset = 0;
    if (s == 4) {
      n[2] = 1;  // behind the camera
    } else {
      n[s / 2] = s % 2 ? -1 : 1;
      (grid.orthographic ? offset : n[2]) = bounds[s];
    }
    Side& side = sides_[s];
    side.offset = offset;
    for (int i = 0; i < 3; ++i) {
      side.normal[i] =
          rotation[3 * i] * n[0] + rotation[3 * i + 1] * n[1] + rotation[3 * i + 2] * n[2];
      side.offset += side.normal[i] * position[i];
    }
    side.image = side.offset;
  }
}

bool Frustum::misses(const float low[3], const float high[3]) const {
  for (const Side& side : sides_) {
    double minimum = -side.offset, scale = 1 + std::abs(side.offset);
    for (int i = 0; i < 3; ++i) {
      const double term = side.normal[i] * (side.normal[i] > 0 ? low[i] : high[i]);
      minimum += term;
      scale += std::abs(term);
    }
    if (minimum > kRelativeSlack * scale) return true;
  }
  return false;
}

void Frustum::reach(const double light[3]) {
  for (Side& side : sides_) side.offset = std::max(side.offset, side.along(light));
}

void Frustum::reach(const double to_light[3], double longest) {
  for (Side& side : sides_) {
    const double rise = side.along(to_light);
    if (rise > 0) side.offset = std::max(side.offset, side.image + rise * longest);
  }
}

void Frustum::widen(double by) {
  for (Side& side : sides_) side.offset += by * std::sqrt(side.along(side.normal));
}

void find_candidates(const rays::BoxList& list, const Frustum& frustum,
                     std::vector<std::uint64_t>& candidates) {
  std::fill(candidates.begin(), candidates.end(), 0);
  list.each([&](int block) { return !misses(list.blocks(), block, frustum); },
            [&](int k) {
              const int id = list.object(k);
              if (!misses(list.all(), k, frustum))
                candidates[id / 64] |= std::uint64_t{1} << id % 64;
            });
}

}  // namespace mjsense::render
