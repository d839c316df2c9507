// SPDX-License-Identifier: Apache-2.0
#pragma once
// A pattern's rays sorted into packets of 16 neighbours, once. Coherent packets are what makes
// casting fast: all rays of one meet the same few geoms.

#include <vector>

#include "mjsense/rays/packet.h"
#include "mjsense/sensors/raycast/pattern.h"

namespace mjsense {

class RayBundle {
 public:
  RayBundle() = default;
  // Rays [first, first + count) of the pattern, numbered from 0 here. They are neighbours if they
  // are close at `depth` metres.
  RayBundle(const RayPattern& pattern, int first, int count, double depth = 3.0);

  int num_rays() const { return num_rays_; }
  int num_packets() const { return static_cast<int>(packets_.size()); }
  const LocalPacket& packet(int p) const { return packets_[p]; }
  // Ray index of each lane of packet p, -1 for lanes without a ray.
  const int* rays(int p) const { return &order_[p * kPacket]; }

 private:
  int num_rays_ = 0;
  std::vector<LocalPacket> packets_;
  std::vector<int> order_;
};

}  // namespace mjsense
