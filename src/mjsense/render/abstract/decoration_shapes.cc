// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/decoration_shapes.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace mjsense::render {
namespace {

constexpr int kSlices = 28;         // MuJoCo's default
constexpr float kWideHead = 1.75f;  // radius of the head relative to the shaft
constexpr float kZero[3] = {0, 0, 0};

struct Ring {
  float radius, z;
};

// The surface between two rings, seen from outside; rings from bottom to top.
void add_ring(const float size[3], Ring bottom, Ring top, ShapeTriangles& out) {
  const float fall = size[0] * (bottom.radius - top.radius), rise = top.z - bottom.z;
  const float length = std::max(std::hypot(fall, rise), 1e-30f);
  for (int i = 0; i < kSlices; ++i) {
    float p[4][3], n[2][3];
    for (int k = 0; k < 2; ++k) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i + k) / kSlices;
      const float c = std::cos(angle), s = std::sin(angle);
      const auto set = [&](float* at, Ring ring) {
        at[0] = ring.radius * size[0] * c;
        at[1] = ring.radius * size[1] * s;
        at[2] = ring.z;
      };
      set(p[k], bottom);
      set(p[2 + k], top);
      n[k][0] = c * rise / length;
      n[k][1] = s * rise / length;
      n[k][2] = fall / length;
    }
    if (bottom.radius > 0) out.add({p[0], n[0]}, {p[1], n[1]}, {p[3], n[1]});
    if (top.radius > 0) out.add({p[0], n[0]}, {p[3], n[1]}, {p[2], n[0]});
  }
}

// A disk at height z that faces up or down.
void add_disk(const float size[3], float radius, float z, bool up, ShapeTriangles& out) {
  const float n[3] = {0, 0, up ? 1.0f : -1.0f}, middle[3] = {0, 0, z};
  for (int i = 0; i < kSlices; ++i) {
    float p[2][3];
    for (int k = 0; k < 2; ++k) {
      const float angle = 2 * std::numbers::pi_v<float> * static_cast<float>(i + k) / kSlices;
      p[k][0] = radius * size[0] * std::cos(angle);
      p[k][1] = radius * size[1] * std::sin(angle);
      p[k][2] = z;
    }
    if (up) {
      out.add({middle, n}, {p[0], n}, {p[1], n});
    } else {
      out.add({middle, n}, {p[1], n}, {p[0], n});
    }
  }
}

}  // namespace

void ShapeTriangles::add(Corner a, Corner b, Corner c) {
  for (const Corner& corner : {a, b, c}) {
    faces.push_back(static_cast<int>(vertices.size() / 3));
    vertices.insert(vertices.end(), corner.position, corner.position + 3);
    normals.insert(normals.end(), corner.normal, corner.normal + 3);
  }
}

ShapeTriangles arrow_triangles(int type, const float size[3]) {
  ShapeTriangles out;
  const float third = size[2] / 3;
  const float wide = type == mjGEOM_ARROW1 ? 1 : kWideHead;
  const auto head = [&](float base, float tip) {
    const bool up = tip > base;
    add_disk(size, wide, base, !up, out);
    if (up) {
      add_ring(size, {wide, base}, {0, tip}, out);
    } else {
      add_ring(size, {0, tip}, {wide, base}, out);
    }
  };
  if (type == mjGEOM_ARROW2) {
    add_ring(size, {1, -third}, {1, third}, out);
    head(third, third + third / 2);
    head(-third, -third - third / 2);
    return out;
  }
  add_disk(size, 1, 0, false, out);
  add_ring(size, {1, 0}, {1, third}, out);
  add_disk(size, 1, third, true, out);
  head(third, third + third / 2);
  return out;
}

ShapeTriangles triangle_triangles(const float size[3], const float mat[9]) {
  ShapeTriangles out;
  float x[3], y[3], up[3];
  for (int k = 0; k < 3; ++k) {
    x[k] = size[0] * mat[3 * k];
    y[k] = size[1] * mat[3 * k + 1];
  }
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    up[k] = mat[3 * i] * mat[3 * j + 1] - mat[3 * j] * mat[3 * i + 1];
  }
  out.add({kZero, up}, {x, up}, {y, up});
  out.add({kZero, up}, {y, up}, {x, up});  // MuJoCo draws both sides with the same normal
  return out;
}

void add_line(const float from[3], const float to[3], const float eye[3], const float ahead[3],
              bool orthographic, float width, float pixel, ShapeTriangles& out) {
  float p[2][2][3];
  const float* ends[2] = {from, to};
  for (int e = 0; e < 2; ++e) {
    float view[3], side[3], length = 0, depth = 0;
    for (int k = 0; k < 3; ++k) {
      view[k] = orthographic ? ahead[k] : ends[e][k] - eye[k];
      depth += ahead[k] * (ends[e][k] - eye[k]);
    }
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      side[k] = view[i] * (to[j] - from[j]) - view[j] * (to[i] - from[i]);
      length += side[k] * side[k];
    }
    const float half = 0.5f * width * pixel * (orthographic ? 1 : std::max(depth, 0.0f)) /
                       std::sqrt(std::max(length, 1e-30f));
    for (int k = 0; k < 3; ++k) {
      p[e][0][k] = ends[e][k] - half * side[k];
      p[e][1][k] = ends[e][k] + half * side[k];
    }
  }
  const auto add = [&](const float* a, const float* b, const float* c) {
    out.add({a, kZero}, {b, kZero}, {c, kZero});
    out.add({a, kZero}, {c, kZero}, {b, kZero});  // the other side
  };
  add(p[0][0], p[0][1], p[1][1]);
  add(p[0][0], p[1][1], p[1][0]);
}

}  // namespace mjsense::render
