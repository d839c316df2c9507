// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/light_space.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mjsense/render/view/image_window.h"

namespace mjsense::render {
namespace {

constexpr int kFaces = 6;  // faces of a cube around a light that shines in all directions
// Cosine: one frame serves a spot with a cutoff of up to 66 degrees.
constexpr float kNarrow = 0.4f;
constexpr float kEndless = std::numeric_limits<float>::infinity();

float length(const float* v) { return std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

// Completes axes[2] to an orthonormal frame.
void complete(LightFrame& f) {
  const float* w = f.axes[2];
  const int minimum = std::abs(w[0]) < std::abs(w[1]) ? (std::abs(w[0]) < std::abs(w[2]) ? 0 : 2)
                                                      : (std::abs(w[1]) < std::abs(w[2]) ? 1 : 2);
  float* u = f.axes[0];
  for (int i = 0; i < 3; ++i) u[i] = (i == minimum) - w[minimum] * w[i];
  const float inverse = 1 / length(u);
  for (int i = 0; i < 3; ++i) u[i] *= inverse;
  for (int i = 0; i < 3; ++i)
    f.axes[1][i] = w[(i + 1) % 3] * u[(i + 2) % 3] - w[(i + 2) % 3] * u[(i + 1) % 3];
}

// A shadow ray from a surface of triangles starts slightly above it; see shadow_of_triangles().
float lift(const ViewGeom& g) {
  return g.bvh ? 1e-4f * std::max(g.radius, std::abs(g.center[2]) + g.radius) : 0;
}

struct Window {
  float low[2] = {-kEndless, -kEndless}, high[2] = {kEndless, kEndless};
  float w = -kEndless;
};

Window window_of(const LightFrame& f, const ViewGeom& g) {
  Window out;
  if (!g.casts) return {{kEndless, kEndless}, {-kEndless, -kEndless}, kEndless};
  if (g.type == mjGEOM_PLANE) return out;
  const float error = kLightError * (length(f.origin) + length(g.center) + g.radius) + lift(g);
  float corners[8][3], seen[3][8];
  box_corners(g, corners);
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 8; ++k) {
      seen[i][k] = f.axes[i][0] * (corners[k][0] - f.origin[0]) +
                   f.axes[i][1] * (corners[k][1] - f.origin[1]) +
                   f.axes[i][2] * (corners[k][2] - f.origin[2]);
    }
  }
  float nearest = seen[2][0];
  for (float w : seen[2]) nearest = std::min(nearest, w);
  nearest -= error;
  if (f.perspective && nearest <= error) return out;  // around the light, or behind it
  out.w = nearest;
  for (int i = 0; i < 2; ++i) {
    if (f.perspective)
      for (int k = 0; k < 8; ++k) seen[i][k] /= seen[2][k];
    float low = seen[i][0], high = low;
    for (float x : seen[i]) {
      low = std::min(low, x);
      high = std::max(high, x);
    }
    const float maximum = std::max(std::abs(low), std::abs(high));
    const float slack = f.perspective ? error * (1 + maximum) / nearest : error;
    out.low[i] = low - slack;
    out.high[i] = high + slack;
  }
  return out;
}

// Sets the side of the geom's box that faces the light along the box's axis i.
void set_side(const ViewLight& light, const ViewGeom& g, int i, int at, LightSides& out) {
  float from = 0, along = 0;
  for (int k = 0; k < 3; ++k) {
    const float axis = g.rot[3 * k + i];
    from +=
        axis * (light.kind == LightKind::kDirectional ? -light.dir[k] : light.pos[k] - g.center[k]);
    along += axis * g.center[k];
  }
  const float side = g.box[3 + i], lit = light.kind == LightKind::kDirectional ? 0 : side;
  const float sign = from > lit ? 1.0f : from < -lit ? -1.0f : 0.0f;
  for (int k = 0; k < 3; ++k) out.normal[i][k][at] = sign * g.rot[3 * k + i];
  const bool faces = sign != 0 && g.type != mjGEOM_PLANE;
  out.offset[i][at] = faces ? sign * along + side + kLightError * g.radius : kEndless;
}

}  // namespace

LightSpace::LightSpace(int lights, std::size_t geoms)
    : stride_(geoms + kWindowPadding),
      frames_(static_cast<std::size_t>(kFaces) * std::min(lights, View::kMaxLights)),
      windows_(kArrays * stride_ * frames_.size()),
      sides_(kSideArrays * stride_ * std::min(lights, View::kMaxLights)) {}

void LightSpace::fill(View& view) {
  std::size_t used = 0;
  float* side = sides_.data();
  for (int i = 0; i < view.num_lights; ++i) {
    const ViewLight& light = view.lights[i];
    view.light_frames[i] = {};
    if (!light.shadows) continue;
    const bool directional = light.kind == LightKind::kDirectional;
    const float size = length(light.dir), cosine = light.cos_cutoff / size;
    const bool narrow = directional || (light.kind == LightKind::kSpot && cosine > kNarrow);
    const int count = narrow ? 1 : kFaces;
    view.light_frames[i] = {&frames_[used], count};
    LightSides& sides = view.light_sides[i];
    for (int k = 0; k < 3; ++k) {
      for (float*& component : sides.normal[k]) component = std::exchange(side, side + stride_);
      sides.offset[k] = std::exchange(side, side + stride_);
      for (int g = 0; g < view.num_geoms; ++g) set_side(light, view.geoms[g], k, g, sides);
    }
    for (int face = 0; face < count; ++face, ++used) {
      LightFrame& f = frames_[used];
      f.perspective = !directional;
      f.limit = kEndless;
      for (int k = 0; k < 3; ++k) {
        f.origin[k] = directional ? 0 : light.pos[k];
        f.axes[2][k] = narrow ? light.dir[k] / size : (face / 2 == k) * (face % 2 ? -1.0f : 1.0f);
      }
      if (narrow && !directional)
        f.limit = 1.001f * std::sqrt(1 - cosine * cosine) / cosine + 1e-3f;
      complete(f);
      float* at = windows_.data() + kArrays * stride_ * used;
      f.windows = {at, at + stride_, at + 2 * stride_, at + 3 * stride_, at + 4 * stride_};
      for (int g = 0; g < view.num_geoms; ++g) {
        const Window window = window_of(f, view.geoms[g]);
        f.windows.u0[g] = window.low[0];
        f.windows.u1[g] = window.high[0];
        f.windows.v0[g] = window.low[1];
        f.windows.v1[g] = window.high[1];
        f.windows.w[g] = window.w;
      }
    }
  }
}

}  // namespace mjsense::render
