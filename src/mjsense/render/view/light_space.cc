// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/light_space.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mjsense/render/view/image_window.h"

namespace mjsense::render {
namespace {

constexpr int kFaces = 6;  // faces of a cube around a light that shines in all directions
// Cosine: one frame serves a spot with a cutoff of up to 66 degrees.
constexpr float kNarrow = 0.4f;

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
  return g.bvh || g.mesh_on_demand ? 1e-4f * std::max(g.radius, std::abs(g.center[2]) + g.radius)
                                   : 0;
}

constexpr int kCorners = 8;
// Corners of a box. Two corners whose indices differ in one bit share an edge.
using Corners = float[kCorners][3];

constexpr LightWindow kNowhere{{kEndless, kEndless}, {-kEndless, -kEndless}, -kEndless};
constexpr LightWindow kEverywhere{{-kEndless, -kEndless}, {kEndless, kEndless}, -kEndless};

// Position of a box in a light's image. Corners may be wrong by `error`, m.
class Seen {
 public:
  Seen(const LightFrame& frame, const Corners& corners, float error)
      : perspective_(frame.perspective), error_(error) {
    for (int k = 0; k < kCorners; ++k) {
      for (int i = 0; i < 3; ++i)
        at_[i][k] = frame.axes[i][0] * (corners[k][0] - frame.origin[0]) +
                    frame.axes[i][1] * (corners[k][1] - frame.origin[1]) +
                    frame.axes[i][2] * (corners[k][2] - frame.origin[2]);
    }
    nearest_ = farthest_ = at_[2][0];
    for (float w : at_[2]) {
      nearest_ = std::min(nearest_, w);
      farthest_ = std::max(farthest_, w);
    }
  }
  float nearest() const { return nearest_ - error_; }
  float farthest() const { return farthest_ + error_; }

  // Contains the part of the box that is in front of the light.
  LightWindow window() const {
    LightWindow out = kNowhere;
    out.w = nearest();
    if (!perspective_) {
      for (int k = 0; k < kCorners; ++k)
        for (int i = 0; i < 2; ++i) add(i, at_[i][k], error_, out);
    } else if (nearest() > error_) {
      for (int k = 0; k < kCorners; ++k)
        for (int i = 0; i < 2; ++i) add_ahead(i, k, nearest(), out);
    } else {
      add_edges(out);
    }
    return out;
  }

 private:
  static void add(int axis, float at, float slack, LightWindow& out) {
    out.low[axis] = std::min(out.low[axis], at - slack);
    out.high[axis] = std::max(out.high[axis], at + slack);
  }
  // `nearest`: lower bound of the corner's w.
  void add_ahead(int axis, int corner, float nearest, LightWindow& out) const {
    const float at = at_[axis][corner] / at_[2][corner];
    add(axis, at, error_ * (1 + std::abs(at)) / nearest, out);
  }
  // Adds the corners ahead of the light, and for edges to other corners the direction in which they
  // leave the image.
  void add_edges(LightWindow& out) const {
    for (int k = 0; k < kCorners; ++k) {
      const float w = at_[2][k];
      if (w <= 2 * error_) continue;
      for (int i = 0; i < 2; ++i) add_ahead(i, k, w - error_, out);
      for (int bit = 1; bit < kCorners; bit *= 2) {
        const int other = k ^ bit;
        const float behind = at_[2][other];
        if (behind > 2 * error_) continue;
        const float s = std::min(w / (w - behind), 1.0f);
        for (int i = 0; i < 2; ++i) {
          const float beside = at_[i][k] + s * (at_[i][other] - at_[i][k]);
          if (beside < 4 * error_) out.low[i] = -kEndless;
          if (beside > -4 * error_) out.high[i] = kEndless;
        }
      }
    }
  }

  bool perspective_;
  float error_, nearest_, farthest_;
  float at_[3][kCorners];
};

// Sets the side of the geom's box that faces the light along the box's axis i.
void set_side(const ViewLight& light, const ViewGeom& g, int i, int at, FacingSides& out) {
  float from = 0, along = 0;
  for (int k = 0; k < 3; ++k) {
    const float axis = g.rot[3 * k + i];
    from +=
        axis * (light.kind == LightKind::kDirectional ? -light.dir[k] : light.pos[k] - g.center[k]);
    along += axis * g.center[k];
  }
  const float side = g.aabb[3 + i], lit = light.kind == LightKind::kDirectional ? 0 : side;
  const float sign = from > lit ? 1.0f : from < -lit ? -1.0f : 0.0f;
  for (int k = 0; k < 3; ++k) out.normal[i][k][at] = sign * g.rot[3 * k + i];
  const bool faces = sign != 0 && g.type != mjGEOM_PLANE;
  out.offset[i][at] = faces ? sign * along + side + kLightError * g.radius : kEndless;
}

}  // namespace

const LightFrame& frame_towards(const LightFrames& frames, const float* low, const float* high) {
  if (frames.count == 1) return *frames.first;
  int face = 0;
  float maximum = -1;
  for (int i = 0; i < 3; ++i) {
    const float x = 0.5f * (low[i] + high[i]) - frames.first->origin[i];
    if (std::abs(x) <= maximum) continue;
    maximum = std::abs(x);
    face = 2 * i + (x < 0);
  }
  return frames.first[face];
}

LightWindow shadow_window(const LightFrame& frame, const ViewGeom& geom) {
  if (!geom.casts_shadows) return {{kEndless, kEndless}, {-kEndless, -kEndless}, kEndless};
  if (geom.type == mjGEOM_PLANE) return kEverywhere;
  Corners corners;
  box_corners(geom, corners);
  const float error =
      kLightError * (length(frame.origin) + length(geom.center) + geom.radius) + lift(geom);
  return Seen(frame, corners, error).window();
}

LightWindow lit_window(const LightFrame& frame, const TileBox& box) {
  Corners corners;
  float reach = 0;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < kCorners; ++k) corners[k][i] = k >> i & 1 ? box.high[i] : box.low[i];
    const float farthest = std::max(std::abs(box.low[i]), std::abs(box.high[i]));
    reach += farthest * farthest;
  }
  const Seen seen(frame, corners, kLightError * (length(frame.origin) + std::sqrt(reach)));
  // Points that are not in front of the light may be in the shadow of anything.
  LightWindow out = frame.perspective && seen.nearest() <= 0 ? kEverywhere : seen.window();
  out.w = seen.farthest();
  return out;
}

LightSpace::LightSpace(int lights, std::size_t geoms)
    : stride_(geoms + kWindowPadding),
      frames_(static_cast<std::size_t>(kFaces) * std::min(lights, kMaxLights)),
      windows_(kArrays * stride_ * frames_.size()),
      sides_(kSideArrays * stride_ * std::min(lights, kMaxLights)) {}

void LightSpace::fill(View& view) {
  std::size_t used = 0;
  float* side = sides_.data();
  for (int i = 0; i < view.num_lights; ++i) {
    const ViewLight& light = view.lights[i];
    view.light_frames[i] = {};
    if (!light.casts_shadows) continue;
    const bool directional = light.kind == LightKind::kDirectional;
    const float size = length(light.dir), cosine = light.cos_cutoff / size;
    const bool narrow = directional || (light.kind == LightKind::kSpot && cosine > kNarrow);
    const int count = narrow ? 1 : kFaces;
    view.light_frames[i] = {&frames_[used], count};
    FacingSides& sides = view.facing_sides[i];
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
        const LightWindow window = shadow_window(f, view.geoms[g]);
        f.windows.u_min[g] = window.low[0];
        f.windows.u_max[g] = window.high[0];
        f.windows.v_min[g] = window.low[1];
        f.windows.v_max[g] = window.high[1];
        f.windows.w_min[g] = window.w;
      }
    }
  }
}

}  // namespace mjsense::render
