// SPDX-License-Identifier: Apache-2.0
#pragma once
// The ray kernels, compiled once per instruction set (kernels_portable.cc, kernels_avx2.cc,
// kernels_avx512.cc; all include kernels_impl.h). This header contains declarations only. An inline
// function here could be compiled with instructions that another CPU lacks, and the linker might
// keep that copy.

#include <cstdint>

#include "mjsense/core/system/cpu.h"

namespace mjsense::rays {

struct LocalPacket;
struct RayPacket;
struct HitPacket;
struct RayOutputs;
struct LidarReturns;
struct RayGeom;
struct RayCandidate;

struct HeightField {
  static constexpr int kBlock = 8;  // cells per side of a block
  const float* data;                // [rows, cols], 0..1; programs may write larger values
  int rows, cols;
  float size[4];  // m: half x, half y, height of the value 1, thickness of the base
  void* scene;  // RTCScene of the surface (z up), face = 2 * cell + triangle; null without cameras
  // [ceil((rows - 1) / kBlock), block_cols] m, maximum height of each block.
  const float* block_tops;
  int block_cols;
  float top;       // m, maximum height
  float lid;       // m, upper side of the box around the surface
  float steepest;  // maximum slope
};

struct KernelScene {
  void* const* mesh_scenes;          // RTCScene by mesh id
  const HeightField* height_fields;  // by height field id
};

// Boxes in the world frame, by coordinate. Padded to a multiple of 16 with boxes that no ray hits.
struct KernelBoxes {
  const float* low[3];
  const float* high[3];
  const int* ids;  // geom id of each box; null: box i is geom i
  int count;
};

struct KernelWorld {
  static constexpr int kBlock = 64;
  const RayGeom* geoms;
  const KernelBoxes& boxes;    // boxes of all geoms and flexes
  const int* box_of_geom;      // box index of each geom; null: geom i has box i
  const KernelBoxes& blocks;   // boxes around each kBlock consecutive boxes; may be empty
  const std::uint32_t* flags;  // [padded]
  const int* bodies;           // [padded]
  void* const* flex_scenes;    // RTCScene by flex id
};

struct KernelFilter {
  std::uint32_t groups;
  int exclude_body;
  bool transparent, cull_mesh, cull_solid;
  const std::uint8_t* hidden;  // nonzero: geom is skipped; null: no geom is
};

struct RayKernels {
  void (*to_world)(const LocalPacket&, const float* rotation, float tmax, RayPacket&);
  // Writes the boxes that any of `count` packets with the same origin can hit into `low`, `high`
  // and `ids`. Returns their number.
  int (*cull)(const KernelWorld&, const KernelFilter&, const RayPacket*, int count,
              float* const* low, float* const* high, int* ids);
  // Writes the candidates of one packet, nearest first, and returns their number. gather()
  // considers all geoms that pass the filter, gather_from() the given boxes.
  int (*gather)(const KernelWorld&, const KernelFilter&, const RayPacket&, RayCandidate* out);
  int (*gather_from)(const KernelBoxes&, const RayPacket&, RayCandidate* out);
  void (*trace)(const KernelScene&, const KernelWorld&, const KernelFilter&, const RayPacket&,
                HitPacket&, const RayCandidate*, int count);
  // Discards hits nearer than `nearest` and clamps the distance of others to `farthest`. `bodies`
  // and `materials` are indexed by geom; null if those ids were not requested.
  void (*rows)(const RayPacket&, float nearest, float farthest, const int* bodies,
               const int* materials, HitPacket&, RayOutputs&);
  // `rgba`: [objects, 4].
  void (*returns)(const LocalPacket&, const RayPacket&, const HitPacket&, const float* rgba,
                  LidarReturns&);
};

const RayKernels& portable_kernels();
const RayKernels& avx2_kernels();
const RayKernels& avx512_kernels();
const RayKernels& kernels_for(Isa isa);

}  // namespace mjsense::rays
