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
inline constexpr FaceHorizon kNoHorizon = {{0, 1e-30f, 0}, 0};

// Of a mesh in clusters. Kernels find out about a face (render/kernels/horizon.h) when they have asked so
// often that rays would have cost as much, so that nobody waits for faces that hardly anybody sees;
// whoever does finds the same.
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

  // Of a ray that begins on the face. Until it has asked `patience` times: kNoHorizon; then `find()`.
  template <class Find>
  FaceHorizon ask(int face, std::uint64_t patience, Find find) const {
    Words& words = faces_[face];
    const std::uint64_t first = words[0].load(std::memory_order_acquire);
    std::uint64_t second = words[1].load(std::memory_order_relaxed);
    if (first != 0) return std::bit_cast<FaceHorizon>(std::array{first, second});
    if (second < patience) {  // a count of questions; that of another thread may be lost
      words[1].compare_exchange_strong(second, second + 1, std::memory_order_relaxed);
      return kNoHorizon;
    }
    FaceHorizon found = find();
    if (found.clear[0] == 0) found.clear[0] = -0.0f;  // whose bits are not all zero
    const auto made = std::bit_cast<std::array<std::uint64_t, 2>>(found);
    words[1].store(made[1], std::memory_order_relaxed);
    words[0].store(made[0], std::memory_order_release);
    return found;
  }

 private:
  // A FaceHorizon in two parts, the second written before the first. While the first is 0, the second
  // counts.
  using Words = std::array<std::atomic<std::uint64_t>, 2>;

  std::vector<int> places_;  // by face
  std::unique_ptr<Words[]> faces_;
};

}  // namespace mjsense
