// SPDX-License-Identifier: Apache-2.0
#pragma once
// How far a mesh rises around each of its faces: rays that leave a face more steeply do not come back to
// the mesh. Most rays to lights are such, and need not be cast against the mesh that they begin on.

#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "mjsense/rays/clusters.h"

namespace mjsense {

// Of a mesh in clusters. What hides the sky on one side of a face need not do so on another: there is a
// horizon for each octant of directions in the mesh's frame (bit i: component i is negative). Kernels
// find out about one (render/kernels/horizon.h) when they have asked so often that rays would have cost
// as much, so that nobody waits for faces that hardly anybody sees; whoever does finds the same.
class Horizons {
 public:
  static constexpr int kOctants = 8;
  // The sine of no direction: no ray is known to be clear.
  static constexpr float kNever = 2;
  // Questions before one is found: it costs 4 us; a lane of a packet that Embree looks at, 0.1.
  static constexpr int kPatience = 50;

  explicit Horizons(const Clusters& clusters) {
    for (std::size_t i = kClusterSize * clusters.blocks.size(); i-- > 0;) {
      const int face = clusters.blocks[i / kClusterSize].face[i % kClusterSize];
      if (places_.size() <= static_cast<std::size_t>(face)) places_.resize(face + 1);
      places_[face] = static_cast<int>(i);  // unused lanes repeat the first of their block
    }
    planes_.reserve(places_.size());
    for (const int place : places_)
      planes_.push_back(plane_of(clusters.blocks[place / kClusterSize], place % kClusterSize));
    sines_ = std::make_unique<std::atomic<std::uint8_t>[]>(kOctants * places_.size());
  }

  // Where a face stands: kClusterSize * block + lane.
  int place(int face) const { return places_[face]; }

  // The face's plane: its unit normal n, and the offset n . x, m. Zeros, if it has no area.
  const float* plane(int face) const { return planes_[face].data(); }

  // The sine of the elevation over the face's plane from which on rays in the octant are clear. Until it
  // was asked for kPatience times: kNever; then `find()`, rounded up.
  template <class Find>
  float ask(int face, int octant, Find find) const {
    std::atomic<std::uint8_t>& known = sines_[kOctants * face + octant];
    std::uint8_t code = known.load(std::memory_order_relaxed);
    if (code <= kPatience) {
      // A count of questions; that of another thread may be lost.
      if (code < kPatience) {
        known.store(code + 1, std::memory_order_relaxed);
        return kNever;
      }
      const int steps = static_cast<int>(std::ceil(find() / kStep));
      code = kLeast + steps < kUnclear ? kLeast + steps : kUnclear;
      known.store(code, std::memory_order_relaxed);
    }
    return code == kUnclear ? kNever : kStep * static_cast<float>(code - kLeast);
  }

 private:
  // A byte counts up to kPatience; beyond it is kLeast and a sine in steps, or kUnclear.
  static constexpr int kLeast = kPatience + 1, kUnclear = 255;
  static constexpr float kStep = 1.0f / (kUnclear - 1 - kLeast);

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

  std::vector<int> places_;  // by face, as the rest
  std::vector<std::array<float, 4>> planes_;
  std::unique_ptr<std::atomic<std::uint8_t>[]> sines_;
};

}  // namespace mjsense
