// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/triangle_clusters.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

namespace mjsense::rays {
namespace {

struct Box {
  std::array<float, 3> low, high;
};
struct Cone {
  std::array<float, 3> axis;
  float spread;  // sine of the angle
};

// Normalised vector; 0 if it has no length.
std::array<float, 3> unit(const std::array<float, 3>& v) {
  const float length = std::hypot(v[0], v[1], v[2]);
  if (!(length > 0)) return {};
  return {v[0] / length, v[1] / length, v[2] / length};
}

class Builder {
 public:
  Builder(const float* vertices, const int* faces, int num_faces)
      : vertices_(vertices),
        faces_(faces),
        order_(num_faces),
        centers_(num_faces),
        normals_(num_faces) {
    std::iota(order_.begin(), order_.end(), 0);
    for (int f = 0; f < num_faces; ++f) {
      for (int k = 0; k < 3; ++k)
        centers_[f][k] = (corner(f, 0)[k] + corner(f, 1)[k] + corner(f, 2)[k]) / 3;
      normals_[f] = normal(f);
    }
  }

  Clusters build() {
    add_node(order_);
    return std::move(out_);
  }

 private:
  using Range = std::span<int>;

  const float* corner(int face, int i) const { return vertices_ + 3 * faces_[3 * face + i]; }

  // Returns the node's index.
  int add_node(Range faces) {
    const int index = static_cast<int>(out_.nodes.size());
    out_.nodes.push_back({});
    std::vector<Range> parts = {faces};
    while (parts.size() < kClusterSize) {
      std::vector<Range> finer;
      for (Range part : parts) halve(part, finer);
      if (finer.size() == parts.size()) break;
      parts = std::move(finer);
    }
    // Halves differ by at most one block, so all leaves appear in the same round and no node has
    // more than kClusterSize children.
    assert(parts.size() <= kClusterSize);
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const bool leaf = parts[i].size() <= kClusterSize;
      const int child = leaf ? ~add_block(parts[i]) : add_node(parts[i]);
      ClusterNode& node = out_.nodes[index];
      const Box box = box_of(parts[i]);
      for (int k = 0; k < 3; ++k) {
        node.center[k][i] = 0.5f * (box.low[k] + box.high[k]);
        node.half[k][i] = 0.5f * (box.high[k] - box.low[k]);
      }
      const Cone cone = cone_of(parts[i]);
      for (int k = 0; k < 3; ++k) node.axis[k][i] = cone.axis[k];
      node.spread[i] = cone.spread;
      node.child[i] = child;
      ++node.count;
    }
    return index;
  }

  // Splits near the middle of the longest side, at a multiple of kClusterSize, so that all blocks
  // but the last are full.
  void halve(Range faces, std::vector<Range>& out) {
    if (faces.size() <= kClusterSize) {
      out.push_back(faces);
      return;
    }
    Box box = {{inf, inf, inf}, {-inf, -inf, -inf}};
    for (int f : faces)
      for (int k = 0; k < 3; ++k) {
        box.low[k] = std::min(box.low[k], centers_[f][k]);
        box.high[k] = std::max(box.high[k], centers_[f][k]);
      }
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (box.high[k] - box.low[k] > box.high[axis] - box.low[axis]) axis = k;
    const std::size_t middle = (faces.size() / 2 + kClusterSize - 1) / kClusterSize * kClusterSize;
    std::nth_element(faces.begin(), faces.begin() + middle, faces.end(), [&](int a, int b) {
      const float x = centers_[a][axis], y = centers_[b][axis];
      return x != y ? x < y : a < b;
    });
    out.push_back(faces.first(middle));
    out.push_back(faces.subspan(middle));
  }

  int add_block(Range faces) {
    TriangleBlock& block = out_.blocks.emplace_back();
    for (std::size_t lane = 0; lane < kClusterSize; ++lane) {
      const bool used = lane < faces.size();
      const int face = faces[used ? lane : 0];
      block.face[lane] = face;
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) block.corners[i][k][lane] = corner(face, used ? i : 0)[k];
    }
    return static_cast<int>(out_.blocks.size()) - 1;
  }

  Box box_of(Range faces) const {
    Box box = {{inf, inf, inf}, {-inf, -inf, -inf}};
    for (int f : faces)
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) {
          box.low[k] = std::min(box.low[k], corner(f, i)[k]);
          box.high[k] = std::max(box.high[k], corner(f, i)[k]);
        }
    return box;
  }

  std::array<float, 3> normal(int face) const {
    const float *a = corner(face, 0), *b = corner(face, 1), *c = corner(face, 2);
    const float u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    const float v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    return unit({u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]});
  }

  Cone cone_of(Range faces) const {
    std::array<float, 3> sum{};
    for (int f : faces)
      for (int k = 0; k < 3; ++k) sum[k] += normals_[f][k];
    Cone cone{unit(sum), 1};
    float cosine = 1;
    for (int f : faces) {
      const std::array<float, 3>& n = normals_[f];
      if (n[0] == 0 && n[1] == 0 && n[2] == 0) continue;  // degenerate triangles are never visible
      cosine = std::min(cosine, n[0] * cone.axis[0] + n[1] * cone.axis[1] + n[2] * cone.axis[2]);
    }
    if (cosine > 0) cone.spread = std::min(1.0f, std::sqrt(1 - cosine * cosine) + 1e-3f);
    return cone;
  }

  static constexpr float inf = std::numeric_limits<float>::infinity();
  const float* vertices_;
  const int* faces_;
  std::vector<int> order_;
  std::vector<std::array<float, 3>> centers_, normals_;
  Clusters out_;
};

}  // namespace

Clusters build_clusters(const float* vertices, const int* faces, int num_faces) {
  if (num_faces == 0) return {};
  return Builder(vertices, faces, num_faces).build();
}

}  // namespace mjsense::rays
