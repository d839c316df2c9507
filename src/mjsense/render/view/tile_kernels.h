// SPDX-License-Identifier: Apache-2.0
#pragma once
// The render kernels: functions that draw tiles of a view, compiled for several instruction sets.

#include <cstddef>

#include "mjsense/render/view/view.h"

namespace mjsense::render {

// Working memory of one thread, which TileMemory owns. Lists of geoms hold indices in View::geoms
// and have room for all of them.
struct TileScratch {
  int* row_geoms = nullptr;  // [num_row_geoms]: geoms visible in the row of tiles
  int num_row_geoms = 0;
  int* opaque_geoms = nullptr;  // visible in the tile
  int* transparent_geoms = nullptr;
  // Geoms that may hide the environment from the tile, and their boxes in this order.
  int* occluders = nullptr;
  OccluderBoxes occluder_boxes;
  // Shadow casters of all lights: kMaxLights entries for each geom, and max_caster_parts.
  int* casters = nullptr;
  LightWindows caster_windows{};
  int max_caster_parts = 0;  // entries for parts of geoms
  void* tile = nullptr;      // TileSpace of the kernels
};

// Size of a TileSpace; it must be aligned to 64 bytes.
std::size_t tile_bytes();

// Renders the rows of tiles [first, last) of the image. Every pixel depends on the view only.
using RenderTiles = void (*)(const View& view, const ImageTargets& targets, int first, int last,
                             TileScratch& scratch);
void render_tiles_portable(const View&, const ImageTargets&, int first, int last, TileScratch&);
void render_tiles_avx2(const View&, const ImageTargets&, int first, int last, TileScratch&);
void render_tiles_avx512(const View&, const ImageTargets&, int first, int last, TileScratch&);

// Whether a tile within `window` may show the geom. Not for transparent geoms, height fields and
// orthographic cameras. `window`: as ViewGeom::window.
using MayShow = bool (*)(const ViewGeom& geom, const float window[4]);
bool may_show_portable(const ViewGeom&, const float window[4]);
bool may_show_avx2(const ViewGeom&, const float window[4]);
bool may_show_avx512(const ViewGeom&, const float window[4]);

// The fastest versions that this CPU supports.
RenderTiles best_render_tiles();
MayShow best_may_show();

}  // namespace mjsense::render
