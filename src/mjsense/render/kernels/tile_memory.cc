// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/kernels/tile_memory.h"

namespace mjsense {

TileMemory::TileMemory(int max_geoms)
    : lists_((3 + View::kMaxLights) * static_cast<std::size_t>(max_geoms)),
      spheres_(4 * (View::kMaxLights * static_cast<std::size_t>(max_geoms) + kSpherePadding)),
      tile_(DType::kUint8, Shape{static_cast<std::int64_t>(tile_bytes())}),
      fixed_(1) {
  scratch_.row = lists_.data();
  scratch_.opaque = scratch_.row + max_geoms;
  scratch_.transparent = scratch_.opaque + max_geoms;
  scratch_.casters = scratch_.transparent + max_geoms;
  const std::size_t stride = spheres_.size() / 4;
  scratch_.spheres = {spheres_.data(), spheres_.data() + stride, spheres_.data() + 2 * stride,
                      spheres_.data() + 3 * stride};
  scratch_.tile = tile_.data();
  scratch_.fixed = fixed_.data();
}

}  // namespace mjsense
