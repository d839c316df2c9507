// SPDX-License-Identifier: Apache-2.0
#pragma once
// The functions that exist once per instruction set (kernels_portable.cc, kernels_avx2.cc,
// kernels_avx512.cc, all made of kernels_impl.h). Structures only: nothing here may be compiled
// into an inline function that another CPU would meet.

#include <cstdint>

namespace mjsense {

struct LocalPacket;
struct RayPacket;
struct HitPacket;
struct HitRows;
struct ReturnRows;
struct RayGeom;
struct RayCandidate;

struct HeightField {
  static constexpr int kBlock = 8;  // cells along a block's side
  const float* data;                // [rows, cols] 0..1
  int rows, cols;
  float size[4];  // m: half x, half y, height of 1, thickness of the base
  void* scene;    // RTCScene of its surface (z up): face 2 * cell + triangle; null without cameras
  const float*
      block_tops;  // [ceil((rows - 1) / kBlock), block_cols] m, highest point of each block
  int block_cols;
  float top;       // m, the highest point
  float steepest;  // the largest slope
};

struct KernelScene {
  void* const* mesh_scenes;          // RTCScene by mesh id
  const HeightField* height_fields;  // by height-field id
};

// Boxes in the world, by coordinate; padded to a multiple of 16 with boxes that nothing meets.
struct KernelBoxes {
  const float* low[3];
  const float* high[3];
  const int* ids;  // of the geoms; null: box i is geom i
  int count;
};

struct KernelWorld {
  static constexpr int kBlock = 64;
  const RayGeom* geoms;
  const KernelBoxes& boxes;    // of all geoms and flexes
  const int* place;            // which of the boxes is a geom's; null: its own number
  const KernelBoxes& blocks;   // around each kBlock boxes that follow each other; none: count is 0
  const std::uint32_t* flags;  // [padded]
  const int* bodies;           // [padded]
  void* const* flex_scenes;    // RTCScene by flex id
};

struct KernelFilter {
  std::uint32_t groups;
  int exclude_body;
  bool transparent, cull_mesh, cull_solid;
  const std::uint8_t* hidden;  // null: none
};

struct RayKernels {
  void (*place)(const LocalPacket&, const float* rotation, float tmax, RayPacket&);
  // Writes the boxes that any of `count` packets of one origin can meet into `low`, `high`, `ids`;
  // returns their number.
  int (*focus)(const KernelWorld&, const KernelFilter&, const RayPacket*, int count,
               float* const* low, float* const* high, int* ids);
  // Writes what one packet can meet, nearest first: of all geoms that pass the filter, or of
  // `boxes`; returns how many.
  int (*gather)(const KernelWorld&, const KernelFilter&, const RayPacket&, RayCandidate* out);
  int (*gather_from)(const KernelBoxes&, const RayPacket&, RayCandidate* out);
  void (*trace)(const KernelScene&, const KernelWorld&, const KernelFilter&, const RayPacket&,
                HitPacket&, const RayCandidate*, int count);
  std::uint32_t (*occluded)(const KernelScene&, const KernelWorld&, const KernelFilter&,
                            const RayPacket&, const RayCandidate*, int count);
  // A hit before `nearest` becomes none; one behind `farthest` is there. Ids by geom; null: not asked
  // for.
  void (*rows)(const RayPacket&, float nearest, float farthest, const int* bodies,
               const int* materials, HitPacket&, HitRows&);
  // rgba: [4 * objects].
  void (*returns)(const LocalPacket&, const RayPacket&, const HitPacket&, const float* rgba,
                  ReturnRows&);
};

const RayKernels& portable_kernels();
const RayKernels& avx2_kernels();
const RayKernels& avx512_kernels();

}  // namespace mjsense
