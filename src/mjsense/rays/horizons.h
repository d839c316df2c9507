// SPDX-License-Identifier: Apache-2.0
#pragma once
// How far a mesh rises around each of its faces: rays that leave a face more steeply do not come back to
// the mesh. Most rays to lights are such, and need not be cast against the mesh that they begin on.

#include <array>
#include <atomic>
#include <bit>
#include <cstdint>
#include <memory>
#include <vector>

#include "mjsense/rays/clusters.h"

namespace mjsense {

// The face's plane, normal . x = offset, with both divided by the sine of the elevation from which
// on rays are clear: clear . x > 1 for a direction x of length 1.
struct FaceHorizon {
  float clear[3], offset;
};

// No ray from the face is known to be clear.
inline constexpr FaceHorizon kNoHorizon = {{0, 1e-30f, 0}, 1e-30f};

// Of a mesh in clusters. Kernels find out about a face when they first ask (render/kernels/horizon.h),
// so that nobody waits for those that nobody sees; whoever does finds the same.
class Horizons {
 public:
  explicit Horizons(const Clusters& clusters) {
    for (std::size_t i = kClusterSize * clusters.blocks.size(); i-- > 0;) {
      const int face = clusters.blocks[i / kClusterSize].face[i % kClusterSize];
      if (places_.size() <= static_cast<std::size_t>(face)) places_.resize(face + 1);
      places_[face] = static_cast<int>(i);  // unused lanes repeat the first of their block
    }
    faces_ = std::make_unique<Words[]>(places_.size());
  }

  // Where a face stands: kClusterSize * block + lane.
  int place(int face) const { return places_[face]; }

  // False: nobody knows yet.
  bool get(int face, FaceHorizon& out) const {
    const std::array<std::uint64_t, 2> words = {faces_[face][0].load(std::memory_order_relaxed),
                                                faces_[face][1].load(std::memory_order_relaxed)};
    out = std::bit_cast<FaceHorizon>(words);
    return words[0] != 0 && words[1] != 0;
  }
  void set(int face, const FaceHorizon& horizon) const {
    const auto words = std::bit_cast<std::array<std::uint64_t, 2>>(horizon);
    for (int i = 0; i < 2; ++i) faces_[face][i].store(words[i], std::memory_order_relaxed);
  }

 private:
  // A FaceHorizon in two parts, each of which is written at once; 0: not yet.
  using Words = std::array<std::atomic<std::uint64_t>, 2>;

  std::vector<int> places_;  // by face
  std::unique_ptr<Words[]> faces_;
};

}  // namespace mjsense
