// SPDX-License-Identifier: Apache-2.0
#pragma once
// Ray casting against B worlds. Geometry (one BVH per mesh) is shared; each world adds its geoms'
// poses. Results equal those of mj_ray to 1e-5 m at 10 m:
//   plane   hit from the front only; infinite where size is 0, at any distance
//   sphere, capsule, ellipsoid, cylinder, box   hit from outside and inside, normal outward
//   mesh    both sides, normal by winding
//   hfield  both sides of the surface, side walls, base box
//   sdf     its mesh, as MuJoCo draws it. mj_ray marches through the field; the two differ by the
//           mesh's resolution
//   flex    the surface that MuJoCo draws, at `radius` around the elements (mj_ray ignores flexes):
//           both sides, normal by winding. flex_surface.h describes the triangles
//   skin    ignored, as by mj_ray; cameras draw skins (skin_shapes.h)
// Hits whose distances differ by less than rounding are a tie: the lower geom id wins.
//
// update() runs in the parallel pass over worlds. Tracing only reads and may run on any number of
// threads at once.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/core/system/cpu.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/ray_world.h"

namespace mjsense::rays {

struct RayKernels;
struct SharedGeometry;

// Candidate geoms of a packet of rays. Create one per thread and reuse it for every query.
class RayScratch {
 public:
  explicit RayScratch(int num_objects);  // RayScene::num_objects()
  std::span<RayCandidate> candidates() { return {candidates_.data(), count}; }
  RayCandidate* data() { return candidates_.data(); }
  std::size_t count = 0;

 private:
  friend class RayScene;
  int stride_, num_boxes_ = 0;
  std::vector<RayCandidate> candidates_;
  std::vector<float> boxes_;  // [6, stride]: boxes found by cull()
  std::vector<int> ids_;
};

class RayScene {
 public:
  // `isa` selects the kernels; it must not exceed cpu_isa().
  RayScene(const mjModel* model, int num_worlds, Isa isa = cpu_isa());
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  const mjModel* model() const { return model_; }
  int num_worlds() const { return static_cast<int>(worlds_.size()); }
  int num_objects() const { return worlds_.empty() ? 0 : worlds_[0].num_objects(); }

  // Copies poses and per-world properties of world.id from world.data and world.model.
  void update(const World& world);
  const RayWorld& world(int id) const { return worlds_[id]; }
  const SharedGeometry& shared() const { return *shared_; }  // used by the cameras' kernels

  // Transforms rays of a sensor to the world. `rotation` is its row-major R_WS; the caller sets the
  // packet's origin.
  void to_world(const LocalPacket& local, const float rotation[9], float tmax,
                RayPacket& rays) const;

  // Finds the nearest hits of 16 rays.
  void trace(int world, const RayFilter& filter, const RayPacket& rays, HitPacket& hits,
             RayScratch& scratch) const;
  // The same in two steps, for callers that know more about which geoms are visible (the tiles of
  // an image). gather() fills `scratch` with the geoms that the packet can hit; trace_candidates()
  // traces only the given candidates.
  void gather(int world, const RayFilter& filter, const RayPacket& rays, RayScratch& scratch) const;
  void trace_candidates(int world, const RayFilter& filter, const RayPacket& rays, HitPacket& hits,
                        std::span<const RayCandidate> candidates) const;
  // For many packets with the same origin: cull() reduces the world to the geoms that any of them
  // can hit, then trace_culled() traces each packet.
  void cull(int world, const RayFilter& filter, std::span<const RayPacket> packets,
            RayScratch& scratch) const;
  void trace_culled(int world, const RayFilter& filter, const RayPacket& rays, HitPacket& hits,
                    RayScratch& scratch) const;
  // Converts hits to sensor outputs. Hits nearer than `nearest` are discarded; distances beyond
  // `farthest` (by rounding) are clamped to it.
  void rows(int world, const RayPacket& rays, float nearest, float farthest, bool ids,
            HitPacket& hits, RayOutputs& out) const;
  void returns(int world, const LocalPacket& local, const RayPacket& rays, const HitPacket& hits,
               LidarReturns& out) const;

  // Casts one ray, for tests and tools. `direction` need not have length 1; t is in metres in any
  // case.
  [[nodiscard]] Hit trace(int world, const RayFilter& filter, const double origin[3],
                          const double direction[3]) const;

 private:
  const mjModel* model_;
  std::unique_ptr<SharedGeometry> shared_;
  const RayKernels* kernels_;
  std::vector<RayWorld> worlds_;
};

}  // namespace mjsense::rays
