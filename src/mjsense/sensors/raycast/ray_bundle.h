// SPDX-License-Identifier: Apache-2.0
#pragma once
// A pattern's rays, sorted once into packets of 16 neighbours. Packets must be coherent for casting
// to be fast: all rays of a packet hit the same few geoms.

#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

#include "mjsense/rays/packet.h"
#include "mjsense/sensors/raycast/pattern.h"

namespace mjsense::sensors {

// Copies `count` values in one piece; the count is a compile-time constant.
template <int count, class T>
void copy_some(const T* from, T* to) {
  std::memcpy(to, from, count * sizeof(T));
}

class RayBundle {
 public:
  RayBundle() = default;
  // Rays [first, first + count) of the pattern, numbered from 0 here. Rays are neighbours if they
  // are close to each other at a distance of `depth` m.
  RayBundle(const RayPattern& pattern, int first, int count, double depth = 3.0);

  int num_rays() const { return num_rays_; }
  int num_packets() const { return static_cast<int>(packets_.size()); }
  const rays::LocalPacket& packet(int p) const { return packets_[p]; }
  // Ray index of each lane of packet p; -1 for lanes without a ray.
  const int* rays(int p) const { return &order_[p * rays::kPacket]; }
  // Calls put(n, lane, ray) until all rays of packet p are covered: lanes lane .. lane + n - 1 are
  // rays ray .. ray + n - 1. n is a compile-time constant, 1 to 4. A ray may be covered twice.
  template <class Put>
  void each_run(int p, const Put& put) const {
    for (int i = first_run_[p]; i < first_run_[p + 1]; ++i) {
      const Run run = runs_[i];
      switch (run.count) {
        case 1:
          put(std::integral_constant<int, 1>(), run.lane, run.ray);
          break;
        case 2:
          put(std::integral_constant<int, 2>(), run.lane, run.ray);
          break;
        case 3:
          put(std::integral_constant<int, 3>(), run.lane, run.ray);
          break;
        default:
          put(std::integral_constant<int, 4>(), run.lane, run.ray);
      }
    }
  }

 private:
  struct Run {
    std::uint8_t lane, count;
    int ray;
  };
  void find_runs(int p);

  int num_rays_ = 0;
  std::vector<rays::LocalPacket> packets_;
  std::vector<int> order_;
  std::vector<Run> runs_;
  std::vector<int> first_run_;  // [packets + 1]
};

}  // namespace mjsense::sensors
