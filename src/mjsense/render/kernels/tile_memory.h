// SPDX-License-Identifier: Apache-2.0
#pragma once
// Owns the memory that TileScratch points to: the work space of one thread.

#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/render/view/tile_kernels.h"

namespace mjsense::render {

class TileMemory {
 public:
  explicit TileMemory(int max_geoms);  // ViewBuilder::max_geoms()
  TileScratch& scratch() { return scratch_; }

 private:
  std::vector<int> geoms_, casters_;
  std::vector<float> windows_;  // of casters
  std::vector<float> boxes_;    // of occluders
  Array tile_;
  TileScratch scratch_;
};

}  // namespace mjsense::render
