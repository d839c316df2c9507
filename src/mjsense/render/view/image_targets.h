// SPDX-License-Identifier: Apache-2.0
#pragma once
// Output of the render kernels: the images, and what is kept by tile for later images.

#include <cstdint>

#include "mjsense/render/view/view_light.h"

namespace mjsense::render {

// Pixels; a tile is 4 x 4 packets of 4 x 4 pixels. Arrays "by tile" list the tiles of an image row
// by row from the top; tiles at its right and lower border may extend beyond it.
inline constexpr int kTileSize = 16;

// Bounding box of points in the camera's frame, m. low > high: no points.
struct TileBox {
  float low[3] = {__builtin_inff(), __builtin_inff(), __builtin_inff()};
  float high[3] = {-__builtin_inff(), -__builtin_inff(), -__builtin_inff()};
};

// A tile of the fixed layer: the image of the fixed geoms alone, which later images start from. Its
// arrays list the pixels of packet 0 first; members are as in Hits of the kernels.
struct alignas(64) FixedTile {
  static constexpr int kPixels = kTileSize * kTileSize;
  float t[kPixels];              // planar depth, m; infinity: no hit
  float u[kPixels], v[kPixels];  // barycentric coordinates in triangles
  float n[3][kPixels];           // normal of the triangle, geom frame, any length
  int id[kPixels];               // ViewGeom::id, or -1
  int prim[kPixels];             // triangle of a mesh; -1 for the walls of a height field
  float rgb[3][kPixels];         // colour (or radiance) where no other geom casts a shadow
  // By light and packet: a bit for each pixel that the light does not reach, because a fixed geom
  // shadows it or it faces away.
  std::uint16_t unlit[kMaxLights][kPixels / 16];
};

// Output images, H x W, rows from the top. Null: not requested.
struct ImageTargets {
  std::uint8_t* rgb = nullptr;           // [H, W, 3]
  float* hdr = nullptr;                  // [H, W, 3], cd/m^2, only for physically based views
  float* depth = nullptr;                // [H, W], m
  std::int32_t* segmentation = nullptr;  // [H, W, 2]
  float* normals = nullptr;              // [H, W, 3]
  float* points = nullptr;               // [H, W, 3], m
  bool depth_along_ray = false;          // instead of planar depth
  int samples = 1;                       // samples per pixel, for rgb and hdr
  FixedTile* fixed_tiles = nullptr;      // by tile; if not null, these are written and no image
  // As with multisampling in OpenGL, use the samples for edges only, and write rgb only. `samples`
  // must be a power of two up to kMaxMultisamples.
  static constexpr int kMaxMultisamples = 16;
  bool multisampled = false;
  // By tile: tiles with 0 are not written. Null: all are.
  const std::uint8_t* changed_tiles = nullptr;
  // By tile, null if not requested: grows to contain the points that the tile shows, which may
  // receive shadows. Used only if the view has shadows or ambient occlusion.
  TileBox* receivers = nullptr;
};

}  // namespace mjsense::render
