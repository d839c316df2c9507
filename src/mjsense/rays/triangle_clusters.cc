// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/triangle_clusters.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
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
  const double x = v[0], y = v[1], z = v[2];
  const float length = static_cast<float>(std::sqrt(x * x + y * y + z * z));
  if (!(length > 0)) return {};
  return {v[0] / length, v[1] / length, v[2] / length};
}

// Orders faces by a coordinate of their centres, then by their indices: the coordinate's bits, as an
// integer with the same order, above the face.
using Key = std::int64_t;

Key key_of(float coordinate, int face) {
  const auto bits = std::bit_cast<std::int32_t>(coordinate + 0.0f);  // -0 becomes 0
  const std::int32_t ordered = bits ^ (bits >> 31 & 0x7fffffff);
  return static_cast<Key>(ordered) << 32 | face;
}

int face_of(Key key) { return static_cast<int>(key & 0x7fffffff); }

// Reorders the keys so that the first `count` are the smallest; as std::nth_element, but two to three
// times as fast because no step depends on a comparison, which the CPU could not predict.
void divide(std::span<Key> keys, std::size_t count) {
  constexpr std::size_t kSample = 7;
  while (keys.size() > 4 * kSample && count > 0 && count < keys.size()) {
    Key sample[kSample];
    for (std::size_t i = 0; i < kSample; ++i) sample[i] = keys[i * keys.size() / kSample];
    std::sort(sample, sample + kSample);
    const Key pivot = sample[count * kSample / keys.size()];
    std::size_t left = 0;
    for (Key& key : keys) {
      const Key here = key;
      key = keys[left];
      keys[left] = here;
      left += here < pivot;
    }
    // The pivot itself is among the others, so that both parts are smaller, or it is the first key.
    if (count <= left) {
      keys = keys.first(left);
    } else if (left > 0) {
      count -= left;
      keys = keys.subspan(left);
    } else {
      std::iter_swap(keys.begin(), std::ranges::min_element(keys));
      --count;
      keys = keys.subspan(1);
    }
  }
  if (count > 0 && count < keys.size())
    std::nth_element(keys.begin(), keys.begin() + count, keys.end());
}

class Builder {
 public:
  Builder(const float* vertices, const int* faces, int num_faces)
      : vertices_(vertices),
        faces_(faces),
        keys_(num_faces),
        centers_(num_faces),
        normals_(num_faces) {
    for (int f = 0; f < num_faces; ++f) {
      keys_[f] = f;
      for (int k = 0; k < 3; ++k)
        centers_[f][k] = (corner(f, 0)[k] + corner(f, 1)[k] + corner(f, 2)[k]) / 3;
      normals_[f] = normal(f);
    }
    const std::size_t blocks = keys_.size() / kClusterSize + 1;
    out_.blocks.reserve(blocks);
    out_.nodes.reserve(blocks / 8 + 2);
  }

  Clusters build() {
    add_node(keys_);
    return std::move(out_);
  }

 private:
  using Range = std::span<Key>;
  using Four [[gnu::vector_size(16)]] = float;  // three coordinates and 0

  const float* corner(int face, int i) const { return vertices_ + 3 * faces_[3 * face + i]; }

  // Returns the box around the node's triangles.
  Box add_node(Range keys) {
    const int index = static_cast<int>(out_.nodes.size());
    out_.nodes.push_back({});
    std::vector<Range> parts = {keys};
    while (parts.size() < kClusterSize) {
      std::vector<Range> finer;
      for (Range part : parts) halve(part, finer);
      if (finer.size() == parts.size()) break;
      parts = std::move(finer);
    }
    // Halves differ by at most one block, so all leaves appear in the same round and no node has
    // more than kClusterSize children.
    assert(parts.size() <= kClusterSize);
    Box around = kNothing;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const bool leaf = parts[i].size() <= kClusterSize;
      const int child =
          leaf ? ~static_cast<int>(out_.blocks.size()) : static_cast<int>(out_.nodes.size());
      const Box box = leaf ? add_block(parts[i]) : add_node(parts[i]);
      ClusterNode& node = out_.nodes[index];
      for (int k = 0; k < 3; ++k) {
        around.low[k] = std::min(around.low[k], box.low[k]);
        around.high[k] = std::max(around.high[k], box.high[k]);
        node.center[k][i] = 0.5f * (box.low[k] + box.high[k]);
        node.half[k][i] = 0.5f * (box.high[k] - box.low[k]);
      }
      const Cone cone = cone_of(parts[i]);
      for (int k = 0; k < 3; ++k) node.axis[k][i] = cone.axis[k];
      node.spread[i] = cone.spread;
      node.child[i] = child;
      ++node.count;
    }
    return around;
  }

  // Splits near the middle of the longest side, at a multiple of kClusterSize, so that all blocks
  // but the last are full.
  void halve(Range keys, std::vector<Range>& out) {
    if (keys.size() <= kClusterSize) {
      out.push_back(keys);
      return;
    }
    Four low = {inf, inf, inf, inf}, high = -low;
    for (const Key key : keys) {
      const Four center = centers_[face_of(key)];
      low = center < low ? center : low;
      high = high < center ? center : high;
    }
    int axis = 0;
    for (int k = 1; k < 3; ++k)
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    const std::size_t middle = (keys.size() / 2 + kClusterSize - 1) / kClusterSize * kClusterSize;
    for (Key& key : keys) key = key_of(centers_[face_of(key)][axis], face_of(key));
    divide(keys, middle);
    out.push_back(keys.first(middle));
    out.push_back(keys.subspan(middle));
  }

  // Returns the box around the block's triangles.
  Box add_block(Range keys) {
    TriangleBlock& block = out_.blocks.emplace_back();
    Box box = kNothing;
    for (std::size_t lane = 0; lane < kClusterSize; ++lane) {
      const bool used = lane < keys.size();
      const int face = face_of(keys[used ? lane : 0]);
      block.face[lane] = face;
      for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) {
          const float x = block.corners[i][k][lane] = corner(face, used ? i : 0)[k];
          box.low[k] = std::min(box.low[k], x);
          box.high[k] = std::max(box.high[k], x);
        }
    }
    return box;
  }

  std::array<float, 3> normal(int face) const {
    const float *a = corner(face, 0), *b = corner(face, 1), *c = corner(face, 2);
    const float u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
    const float v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    return unit({u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]});
  }

  Cone cone_of(Range keys) const {
    std::array<float, 3> sum{};
    for (const Key key : keys)
      for (int k = 0; k < 3; ++k) sum[k] += normals_[face_of(key)][k];
    Cone cone{unit(sum), 1};
    float cosine = 1;
    for (const Key key : keys) {
      const std::array<float, 3>& n = normals_[face_of(key)];
      if (n[0] == 0 && n[1] == 0 && n[2] == 0) continue;  // degenerate triangles are never visible
      cosine = std::min(cosine, n[0] * cone.axis[0] + n[1] * cone.axis[1] + n[2] * cone.axis[2]);
    }
    if (cosine > 0) cone.spread = std::min(1.0f, std::sqrt(1 - cosine * cosine) + 1e-3f);
    return cone;
  }

  static constexpr float inf = std::numeric_limits<float>::infinity();
  static constexpr Box kNothing = {{inf, inf, inf}, {-inf, -inf, -inf}};
  const float* vertices_;
  const int* faces_;
  std::vector<Key> keys_;      // of the faces; the upper bits are those of the last division
  std::vector<Four> centers_;  // by face
  std::vector<std::array<float, 3>> normals_;  // by face
  Clusters out_;
};

}  // namespace

Clusters build_clusters(const float* vertices, const int* faces, int num_faces) {
  if (num_faces == 0) return {};
  return Builder(vertices, faces, num_faces).build();
}

}  // namespace mjsense::rays
