// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/box_list.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

namespace mjsense::rays {
namespace {

constexpr int kPad = 16, kBlock = KernelWorld::kBlock;
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr float kLarge = 1e3f;  // m; boxes of this size or larger are not grouped by position

int pad(int count) { return (count + kPad - 1) / kPad * kPad; }

KernelBoxes view(const std::vector<float>& boxes, const int* ids, int count) {
  KernelBoxes out{{}, {}, ids, count};
  const std::size_t stride = pad(count);
  for (int k = 0; k < 3; ++k) {
    out.low[k] = boxes.data() + k * stride;
    out.high[k] = boxes.data() + (3 + k) * stride;
  }
  return out;
}

// Moves the lower 10 bits of x to every third bit of the result.
std::uint32_t spread(std::uint32_t x) {
  x = (x | x << 16) & 0x030000FFu;
  x = (x | x << 8) & 0x0300F00Fu;
  x = (x | x << 4) & 0x030C30C3u;
  return (x | x << 2) & 0x09249249u;
}

}  // namespace

BoxList::BoxList(int count)
    : count_(count), padded_(pad(count)), boxes_(6 * static_cast<std::size_t>(padded_)) {
  all_ = view(boxes_, nullptr, count);
  if (count < kMany) return;
  num_blocks_ = (count + kBlock - 1) / kBlock;
  blocks_.resize(6 * static_cast<std::size_t>(pad(num_blocks_)));
  stale_.assign(num_blocks_, 1);
  ids_.resize(padded_);
  std::iota(ids_.begin(), ids_.end(), 0);
  box_of_geom_ = ids_;
  all_.ids = ids_.data();
  around_ = view(blocks_, nullptr, num_blocks_);
}

void BoxList::set(int i, const float low[3], const float high[3]) {
  const int at = num_blocks_ > 0 ? box_of_geom_[i] : i;
  for (int k = 0; k < 3; ++k) {
    this->low(k)[at] = low[k];
    this->high(k)[at] = high[k];
  }
  if (num_blocks_ > 0) stale_[at / kBlock] = 1;
}

void BoxList::update() {
  if (num_blocks_ == 0) return;
  if (!sorted_) sort();
  for (int b = 0; b < num_blocks_; ++b) {
    if (stale_[b]) surround(b);
  }
}

// Sorts the boxes along a Morton curve, which visits all of a region before it leaves it. Large and
// infinite boxes come first.
void BoxList::sort() {
  std::array<float, 3> minimum{kInf, kInf, kInf}, maximum{-kInf, -kInf, -kInf};
  const auto is_large = [&](int i) {
    for (int k = 0; k < 3; ++k)
      if (!(high(k)[i] - low(k)[i] < kLarge)) return true;
    return false;
  };
  const auto middle = [&](int i, int k) { return 0.5f * (low(k)[i] + high(k)[i]); };
  for (int i = 0; i < count_; ++i) {
    if (is_large(i)) continue;
    for (int k = 0; k < 3; ++k) {
      minimum[k] = std::min(minimum[k], middle(i, k));
      maximum[k] = std::max(maximum[k], middle(i, k));
    }
  }
  const float side =
      std::max({maximum[0] - minimum[0], maximum[1] - minimum[1], maximum[2] - minimum[2], 1e-6f});
  std::vector<std::uint32_t> code(count_, 0);
  for (int i = 0; i < count_; ++i) {
    if (is_large(i)) continue;
    code[i] = 1u << 31;
    for (int k = 0; k < 3; ++k)
      code[i] |= spread(static_cast<std::uint32_t>((middle(i, k) - minimum[k]) / side * 1023.0f))
                 << k;
  }
  std::stable_sort(ids_.begin(), ids_.begin() + count_,
                   [&](int a, int b) { return code[a] < code[b]; });
  const std::vector<float> before = boxes_;
  for (int at = 0; at < count_; ++at) {
    box_of_geom_[ids_[at]] = at;
    for (int k = 0; k < 6; ++k)
      low(k)[at] = before[static_cast<std::size_t>(k) * padded_ + ids_[at]];
  }
  std::ranges::fill(stale_, 1);
  sorted_ = true;
}

void BoxList::surround(int block) {
  const int first = block * kBlock, last = std::min(first + kBlock, count_);
  const std::size_t stride = pad(num_blocks_);
  for (int k = 0; k < 3; ++k) {
    blocks_[k * stride + block] = *std::min_element(low(k) + first, low(k) + last);
    blocks_[(3 + k) * stride + block] = *std::max_element(high(k) + first, high(k) + last);
  }
  stale_[block] = 0;
}

}  // namespace mjsense::rays
