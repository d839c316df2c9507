// SPDX-License-Identifier: Apache-2.0
#pragma once
// Rays that another program gives in the world's frame, cast into worlds that are shown in its arrays.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "mjsense/core/system/thread_pool.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::rays {

// B worlds with n rays each. Arrays are dense: [B, n, 3] or [B, n].
struct ForeignRaysQuery {
  int count = 0;                                          // n
  const float *origins = nullptr, *directions = nullptr;  // of any length
  const int* exclude = nullptr;          // [n]: body whose geoms are not hit; -1: none
  std::uint32_t groups = 0x3f;           // of geoms that are hit
  std::span<const std::uint8_t> hidden;  // nonzero: the geom is not hit
  float* distances = nullptr;            // in lengths of the direction; -1: no hit
  int* geoms = nullptr;                  // -1: no hit
  float* normals = nullptr;              // 0 without a hit
};

class ForeignRays {
 public:
  // `worlds` are those of all later calls.
  ForeignRays(const worlds::Worlds& worlds);
  // Casts rays into the worlds, whose poses are current.
  void cast(worlds::Worlds& worlds, const ForeignRaysQuery& query);
  // Copies the worlds' poses to scene(), for images. `also` is called with each world's model, by many
  // threads.
  using Also = std::function<void(const mjModel* model, int world)>;
  void update(worlds::Worlds& worlds, const Also& also = {});
  const RayScene& scene() const { return scene_; }
  ThreadPool& pool() { return pool_; }

 private:
  void cast_packets(int world, int begin, int end, const ForeignRaysQuery& query,
                    RayScratch& scratch) const;

  RayScene scene_;
  ThreadPool pool_;
  std::vector<RayScratch> scratch_;  // by thread
};

}  // namespace mjsense::rays
