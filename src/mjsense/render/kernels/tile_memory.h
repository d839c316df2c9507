// SPDX-License-Identifier: Apache-2.0
#pragma once
// Owns what TileScratch points to: the work space of one thread.

#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/render/view/view.h"

namespace mjsense {

class TileMemory {
 public:
  explicit TileMemory(int max_geoms);  // ViewBuilder::max_geoms()
  TileScratch& scratch() { return scratch_; }

 private:
  std::vector<int> lists_;
  std::vector<float> spheres_;
  Array tile_;
  std::vector<FixedTile> fixed_;
  TileScratch scratch_;
};

}  // namespace mjsense
