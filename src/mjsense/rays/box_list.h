// SPDX-License-Identifier: Apache-2.0
#pragma once
// World-space bounding boxes of the objects of one world, in the layout of the ray kernels. Few
// boxes are tested one after the other. Many boxes are grouped into blocks of neighbours with a box
// around each block, so that a packet skips most of them at once. The grouping is computed once,
// from the first poses. An object that later moves far from its neighbours makes its block's box
// large, but does not change any result.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mjsense/rays/kernels.h"

namespace mjsense::rays {

class BoxList {
 public:
  // Minimum number of objects for blocks. M rays/s of ray_scene_bench before blocks were added and
  // with them: 1,000 boxes 29 and 39, 10,000 boxes 3.8 and 13.
  static constexpr int kMany = 512;

  explicit BoxList(int count);
  BoxList(BoxList&&) = default;
  BoxList(const BoxList&) = delete;

  int padded() const { return padded_; }  // number of objects, rounded up to a multiple of 16
  // Sets the box of object i: its corners in the world frame, m. Planes reach to +-1e30.
  void set(int i, const float low[3], const float high[3]);
  // Call after set() and before all() or blocks() are read.
  void update();

  const KernelBoxes& all() const { return all_; }
  const KernelBoxes& blocks() const { return around_; }
  // Calls visit(k) for each box of all(), except for the boxes of a block b with enter(b) == false.
  template <typename Enter, typename Visit>
  void each(Enter enter, Visit visit) const {
    constexpr int kBlock = KernelWorld::kBlock;
    for (int first = 0; first < all_.count; first += kBlock) {
      if (around_.count > 0 && !enter(first / kBlock)) continue;
      for (int k = first; k < std::min(first + kBlock, all_.count); ++k) visit(k);
    }
  }
  int object(int k) const { return all_.ids ? all_.ids[k] : k; }  // object of box k
  const int* box_of_geom() const { return box_of_geom_.empty() ? nullptr : box_of_geom_.data(); }

 private:
  float* low(int k) { return boxes_.data() + static_cast<std::size_t>(k) * padded_; }
  float* high(int k) { return low(3 + k); }
  void sort();
  void surround(int block);

  int count_, padded_;
  std::vector<float> boxes_;  // [6, padded]: minimum x, y, z, maximum x, y, z
  bool sorted_ = false;
  // Object of each box, and box of each object. Empty: box i is object i.
  std::vector<int> ids_, box_of_geom_;
  int num_blocks_ = 0;
  std::vector<float> blocks_;        // [6, padded]
  std::vector<std::uint8_t> stale_;  // blocks with a box that set() changed
  KernelBoxes all_{}, around_{};     // views of boxes_ and blocks_, whose memory never moves
};

}  // namespace mjsense::rays
