// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/raycast/ray_bundle.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <span>

namespace mjsense::sensors {
namespace {

// Start of each ray and its point at `depth`. Rays that are close in these six numbers are put into
// the same packet.
using Key = std::array<double, 6>;

void split(std::span<int> rays, std::span<const Key> keys) {
  if (static_cast<int>(rays.size()) <= rays::kPacket) {
    std::sort(rays.begin(), rays.end());
    return;
  }
  int widest = 0;
  double maximum = -1;
  for (int k = 0; k < 6; ++k) {
    const auto [low, high] = std::minmax_element(
        rays.begin(), rays.end(), [&](int a, int b) { return keys[a][k] < keys[b][k]; });
    const double width = keys[*high][k] - keys[*low][k];
    if (width > maximum * (1 + 1e-9)) {
      maximum = width;
      widest = k;
    }
  }
  const std::size_t packets = (rays.size() + rays::kPacket - 1) / rays::kPacket,
                    left = packets / 2 * rays::kPacket;
  std::nth_element(rays.begin(), rays.begin() + left, rays.end(), [&](int a, int b) {
    return keys[a][widest] != keys[b][widest] ? keys[a][widest] < keys[b][widest] : a < b;
  });
  split(rays.first(left), keys);
  split(rays.subspan(left), keys);
}

}  // namespace

RayBundle::RayBundle(const RayPattern& pattern, int first, int count, double depth)
    : num_rays_(count) {
  std::vector<Key> keys(num_rays_);
  for (int i = 0; i < num_rays_; ++i)
    for (int k = 0; k < 3; ++k) {
      keys[i][k] = pattern.offsets[first + i][k];
      keys[i][3 + k] = pattern.offsets[first + i][k] + depth * pattern.directions[first + i][k];
    }
  std::vector<int> rays(num_rays_);
  std::iota(rays.begin(), rays.end(), 0);
  split(rays, keys);

  const int num_packets = (num_rays_ + rays::kPacket - 1) / rays::kPacket;
  packets_.resize(num_packets);
  order_.assign(num_packets * rays::kPacket, -1);
  std::copy(rays.begin(), rays.end(), order_.begin());
  first_run_.push_back(0);
  for (int p = 0; p < num_packets; ++p) {
    find_runs(p);
    for (int i = 0; i < rays::kPacket; ++i) {
      const int ray = order_[p * rays::kPacket + i];
      // Lanes without a ray repeat the first lane.
      const int source = ray >= 0 ? ray : order_[p * rays::kPacket];
      packets_[p].active[i] = ray >= 0 ? 1.0f : -1.0f;
      for (int k = 0; k < 3; ++k) {
        packets_[p].o[k][i] = static_cast<float>(pattern.offsets[first + source][k]);
        packets_[p].d[k][i] = static_cast<float>(pattern.directions[first + source][k]);
      }
    }
  }
}

void RayBundle::find_runs(int p) {
  const int* ray = rays(p);
  for (int begin = 0, end; begin < rays::kPacket && ray[begin] >= 0; begin = end) {
    end = begin + 1;
    while (end < rays::kPacket && ray[end] == ray[begin] + end - begin) ++end;
    const int count = std::min(4, end - begin);
    // The last part overlaps the one before, so that it is as long as the others.
    for (int i = begin; i < end; i += count) {
      const int lane = std::min(i, end - count);
      runs_.push_back(
          {static_cast<std::uint8_t>(lane), static_cast<std::uint8_t>(count), ray[lane]});
    }
  }
  first_run_.push_back(static_cast<int>(runs_.size()));
}

}  // namespace mjsense::sensors
