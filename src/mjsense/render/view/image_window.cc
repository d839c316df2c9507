// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/image_window.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>

namespace mjsense::render {
namespace {

constexpr float kNearest = 1e-4f;  // m; nearer points count as behind the camera

}  // namespace

void box_corners(const ViewGeom& g, float (*corners)[3]) {
  const float* h = g.aabb + 3;
  for (int i = 0; i < 3; ++i) {
    const float x = h[0] * g.rot[3 * i], y = h[1] * g.rot[3 * i + 1], z = h[2] * g.rot[3 * i + 2];
    const float left = g.center[i] - x, right = g.center[i] + x;
    corners[0][i] = left - y - z;
    corners[1][i] = right - y - z;
    corners[2][i] = left + y - z;
    corners[3][i] = right + y - z;
    corners[4][i] = left - y + z;
    corners[5][i] = right - y + z;
    corners[6][i] = left + y + z;
    corners[7][i] = right + y + z;
  }
}

bool find_window(const View& view, ViewGeom& g) {
  const PixelGrid& grid = view.grid;
  for (int i = 0; i < 3; ++i)
    g.center[i] = g.pos[i] + g.rot[3 * i] * g.aabb[0] + g.rot[3 * i + 1] * g.aabb[1] +
                  g.rot[3 * i + 2] * g.aabb[2];
  const float* h = g.aabb + 3;
  g.radius =
      g.type == mjGEOM_SPHERE ? g.size[0] : std::sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
  g.window[0] = g.window[2] = -kEndless;
  g.window[1] = g.window[3] = kEndless;
  g.min_depth = 0;
  if (g.type == mjGEOM_PLANE) {
    g.radius = kEndless;
    return true;
  }
  float corners[8][3], nearest = kEndless, farthest = -kEndless;
  box_corners(g, corners);
  for (const float* c : corners) {
    nearest = std::min(nearest, -c[2]);
    farthest = std::max(farthest, -c[2]);
  }
  if (farthest <= view.near || (view.far > 0 && nearest >= view.far)) return false;
  g.min_depth = std::max(nearest - 1e-5f * (1 + std::abs(nearest)), 0.0f);
  float window[4] = {kEndless, -kEndless, kEndless, -kEndless};
  const auto show = [&](float x, float y, float depth, float error) {
    const float scale = 1.0f / depth;
    window[0] = std::min(window[0], (x - error) * scale);
    window[1] = std::max(window[1], (x + error) * scale);
    window[2] = std::min(window[2], (y - error) * scale);
    window[3] = std::max(window[3], (y + error) * scale);
  };
  for (int corner = 0; corner < 8; ++corner) {
    const float *c = corners[corner], depth = -c[2];
    if (grid.orthographic || depth >= kNearest) {
      show(c[0], c[1], grid.orthographic ? 1.0f : depth, 0.0f);
      continue;
    }
    // For a corner not in front of the camera, use the points where its edges cross the plane of
    // depth kNearest.
    for (int k = 0; k < 3; ++k) {
      const float *d = corners[corner ^ (1 << k)], beyond = -d[2];
      if (beyond <= kNearest) continue;
      const float s = (kNearest - depth) / (beyond - depth);
      show(c[0] + s * (d[0] - c[0]), c[1] + s * (d[1] - c[1]), kNearest, 1e-6f * g.radius);
    }
  }
  for (int i = 0; i < 4; ++i) {
    const float slack = 1e-5f * (1 + std::abs(window[i]));
    g.window[i] = window[i] + (i % 2 ? slack : -slack);
  }
  if (grid.distorted_rays) return true;  // the image's corners do not bound it
  const float right = grid.left + grid.dx * grid.width, bottom = grid.top + grid.dy * grid.height;
  return g.window[0] <= right && g.window[1] >= grid.left && g.window[2] <= grid.top &&
         g.window[3] >= bottom;
}

}  // namespace mjsense::render
