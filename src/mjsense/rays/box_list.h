// SPDX-License-Identifier: Apache-2.0
#pragma once
// The boxes around the objects of one world, as the kernels test them. A few are tested one after
// the other; many stand in blocks of neighbours with a box around each, so that a packet passes by
// most of them at once. Who is whose neighbour is found once, from the first poses: what moves far
// from its neighbours makes their block large, never an answer wrong.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mjsense/rays/kernels.h"

namespace mjsense {

class BoxList {
 public:
  // Objects from which on there are blocks. M rays/s of ray_scene_bench without them (before there
  // were any) and with them: 1,000 boxes 29 and 39, 10,000 3.8 and 13.
  static constexpr int kMany = 512;

  explicit BoxList(int count);
  BoxList(BoxList&&) = default;
  BoxList(const BoxList&) = delete;

  int padded() const { return padded_; }  // count, a multiple of 16
  // Of object i: corners in the world, m; planes reach to +-1e30.
  void set(int i, const float low[3], const float high[3]);
  // After boxes were set.
  void update();

  const KernelBoxes& all() const { return all_; }
  const KernelBoxes& blocks() const { return around_; }
  // visit(k) for each box of all(), but for those of a block b for which enter(b) is false.
  template <typename Enter, typename Visit>
  void each(Enter enter, Visit visit) const {
    constexpr int kBlock = KernelWorld::kBlock;
    for (int first = 0; first < all_.count; first += kBlock) {
      if (around_.count > 0 && !enter(first / kBlock)) continue;
      for (int k = first; k < std::min(first + kBlock, all_.count); ++k) visit(k);
    }
  }
  int object(int k) const { return all_.ids ? all_.ids[k] : k; }  // of box k
  const int* place() const { return place_.empty() ? nullptr : place_.data(); }

 private:
  float* low(int k) { return boxes_.data() + static_cast<std::size_t>(k) * padded_; }
  float* high(int k) { return low(3 + k); }
  void sort();
  void surround(int block);

  int count_, padded_;
  std::vector<float> boxes_;  // [6, padded]: least x, y, z, greatest x, y, z
  bool sorted_ = false;
  std::vector<int> ids_, place_;  // object of a box, box of an object; empty: each its own
  int num_blocks_ = 0;
  std::vector<float> blocks_;        // [6, padded]
  std::vector<std::uint8_t> stale_;  // blocks of which a box was set
  KernelBoxes all_{}, around_{};     // of boxes_ and blocks_, whose memory stays where it is
};

}  // namespace mjsense
