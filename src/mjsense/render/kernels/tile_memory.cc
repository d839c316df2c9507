// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/kernels/tile_memory.h"

namespace mjsense::render {

namespace {

constexpr int kSpareCasters = 4096;  // parts (nodes or blocks of triangles)

}  // namespace

TileMemory::TileMemory(int max_geoms)
    : geoms_(4 * static_cast<std::size_t>(max_geoms)),
      casters_(kMaxLights * static_cast<std::size_t>(max_geoms) + kSpareCasters),
      windows_(5 * (casters_.size() + kWindowPadding)),
      boxes_(OccluderBoxes::kRows * (static_cast<std::size_t>(max_geoms) + kWindowPadding)),
      tile_(DType::kUint8, Shape{static_cast<std::int64_t>(tile_bytes())}) {
  scratch_.row_geoms = geoms_.data();
  scratch_.opaque_geoms = scratch_.row_geoms + max_geoms;
  scratch_.transparent_geoms = scratch_.opaque_geoms + max_geoms;
  scratch_.occluders = scratch_.transparent_geoms + max_geoms;
  scratch_.occluder_boxes = {boxes_.data(), boxes_.size() / OccluderBoxes::kRows};
  scratch_.casters = casters_.data();
  scratch_.max_caster_parts = kSpareCasters;
  const std::size_t stride = windows_.size() / 5;
  float* w = windows_.data();
  scratch_.caster_windows = {w, w + stride, w + 2 * stride, w + 3 * stride, w + 4 * stride};
  scratch_.tile = tile_.data();
}

}  // namespace mjsense::render
