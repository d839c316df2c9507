// SPDX-License-Identifier: Apache-2.0
#pragma once
// Horizons of a mesh: how high the mesh rises around each of its faces. Rays that leave a face more
// steeply than its horizon do not hit the mesh again. Most shadow rays do, so they need not be cast
// against the mesh on which they start.

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "mjsense/rays/triangle_clusters.h"

namespace mjsense::rays {

// Horizons of a mesh in clusters. The mesh may occlude the sky on one side of a face and not on
// another, so each face has a horizon for every octant of directions in the mesh's frame (bit i of
// the octant: component i is negative). A horizon is computed by the kernels
// (render/kernels/mesh_horizons.h) only after it was queried so often that casting the rays would
// have cost as much; faces that are rarely visible cost nothing. The computed value does not depend
// on which thread computes it or when.
class Horizons {
 public:
  static constexpr int kOctants = 8;
  // For faces without a horizon: larger than any sine, so no ray is known to miss the mesh.
  static constexpr float kNever = 2;
  // Number of queries before a horizon is computed. Computing one costs 4 us; a packet's lane that
  // Embree casts costs 0.1 us.
  static constexpr int kMaxRequests = 50;

  explicit Horizons(const Clusters& clusters) {
    const std::size_t lanes = kClusterSize * clusters.blocks.size();
    slots_.resize(lanes);
    planes_.resize(lanes);
    int last = -1;
    for (std::size_t i = lanes; i-- > 0;) {
      const TriangleBlock& block = clusters.blocks[i / kClusterSize];
      const int lane = static_cast<int>(i % kClusterSize), face = block.face[lane];
      // Unused lanes repeat the first lane of their block; the lowest index wins.
      slots_[face] = static_cast<int>(i);
      planes_[face] = plane_of(block, lane);
      last = std::max(last, face);
    }
    slots_.resize(last + 1);
    planes_.resize(last + 1);
    sines_ = std::make_unique<std::atomic<std::uint8_t>[]>(kOctants * slots_.size());
  }

  // Index of a face in the clusters: kClusterSize * block + lane.
  int slot(int face) const { return slots_[face]; }

  // The face's plane: its unit normal n, and the offset n . x, m. All zeros if the face has no
  // area.
  const float* plane(int face) const { return planes_[face].data(); }

  // Returns the sine of the elevation above the face's plane from which all rays in the octant are
  // clear of the mesh: kNever for the first kMaxRequests queries, then the result of `find()`,
  // rounded up.
  template <class Find>
  float ask(int face, int octant, Find find) const {
    std::atomic<std::uint8_t>& known = sines_[kOctants * face + octant];
    std::uint8_t code = known.load(std::memory_order_relaxed);
    if (code <= kMaxRequests) {
      // Number of queries. Concurrent increments may be lost, which is harmless.
      if (code < kMaxRequests) {
        known.store(code + 1, std::memory_order_relaxed);
        return kNever;
      }
      const int steps = static_cast<int>(std::ceil(find() / kStep));
      code = kMin + steps < kUnclear ? kMin + steps : kUnclear;
      known.store(code, std::memory_order_relaxed);
    }
    return code == kUnclear ? kNever : kStep * static_cast<float>(code - kMin);
  }

 private:
  // Values of a byte: up to kMaxRequests a count of queries, then kMin plus the sine in steps, and
  // kUnclear.
  static constexpr int kMin = kMaxRequests + 1, kUnclear = 255;
  static constexpr float kStep = 1.0f / (kUnclear - 1 - kMin);

  static std::array<float, 4> plane_of(const TriangleBlock& block, int lane) {
    float a[3], b[3], n[3];
    for (int k = 0; k < 3; ++k) {
      a[k] = block.corners[1][k][lane] - block.corners[0][k][lane];
      b[k] = block.corners[2][k][lane] - block.corners[0][k][lane];
    }
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      n[k] = a[i] * b[j] - a[j] * b[i];
    }
    const float size = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    std::array<float, 4> out = {};
    if (!(size > 0)) return out;
    for (int k = 0; k < 3; ++k) {
      out[k] = n[k] / size;
      out[3] += out[k] * block.corners[0][k][lane];
    }
    return out;
  }

  std::vector<int> slots_;  // this and the following arrays are indexed by face
  std::vector<std::array<float, 4>> planes_;
  std::unique_ptr<std::atomic<std::uint8_t>[]> sines_;
};

}  // namespace mjsense::rays
