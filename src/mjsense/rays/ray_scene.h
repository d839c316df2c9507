// SPDX-License-Identifier: Apache-2.0
#pragma once
// Everything that rays and cameras of B worlds can hit. Geometry (a BVH per mesh) exists once; a
// world adds its geoms' poses. Answers are those of mj_ray, to 1e-5 m at 10 m:
//   plane   from the front only; endless where size is 0, at any distance
//   sphere, capsule, ellipsoid, cylinder, box   from outside and inside, normal outward
//   mesh    both sides, normal by winding
//   hfield  both sides of the surface, side walls, base box
//   sdf     its mesh, as MuJoCo draws it: mj_ray marches the field, they differ by its resolution
//   flex    the surface that MuJoCo draws, `radius` around its elements (mj_ray does not see flexes):
//           both sides, normal by winding; flex_surface.h says which triangles
//   skin    not seen, as by mj_ray; cameras see them (skin_shapes.h)
// Hits nearer to each other than rounding are a tie: the lower geom id wins.
//
// update() runs in the parallel pass over worlds; tracing reads only and may run on any number of
// threads at once.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/core/cpu.h"
#include "mjsense/core/sensor.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/ray_world.h"

namespace mjsense {

struct RayKernels;
struct SharedGeometry;

// Geoms that a packet of rays may meet. One a thread, made once, reused by every query.
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
  std::vector<float> boxes_;  // [6, stride]: what focus() found
  std::vector<int> ids_;
};

class RayScene {
 public:
  // `isa`: which kernels; not more than cpu_isa() finds.
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
  const SharedGeometry& shared() const { return *shared_; }  // for the kernels of cameras

  // Rays of a sensor whose rotation is `rotation` (row-major R_WS); origin is the caller's to set.
  void place(const LocalPacket& local, const float rotation[9], float tmax, RayPacket& rays) const;

  // Nearest hits of 16 rays.
  void trace(int world, const RayFilter& filter, const RayPacket& rays, HitPacket& hits,
             RayScratch& scratch) const;
  // The same in two steps, for callers that know more about which geoms are in sight (the tiles of
  // an image): gather() fills scratch with what the packet can meet; trace_candidates() traces
  // these and nothing else.
  void gather(int world, const RayFilter& filter, const RayPacket& rays, RayScratch& scratch) const;
  void trace_candidates(int world, const RayFilter& filter, const RayPacket& rays, HitPacket& hits,
                        std::span<const RayCandidate> candidates) const;
  // For many packets of one origin: focus() narrows the world to what any of them can meet,
  // trace_focused() then traces each.
  void focus(int world, const RayFilter& filter, std::span<const RayPacket> packets,
             RayScratch& scratch) const;
  void trace_focused(int world, const RayFilter& filter, const RayPacket& rays, HitPacket& hits,
                     RayScratch& scratch) const;
  // What was hit, as sensors report it. A hit before `nearest` becomes none; one behind `farthest`,
  // by rounding, is there.
  void rows(int world, const RayPacket& rays, float nearest, float farthest, bool ids,
            HitPacket& hits, HitRows& out) const;
  void returns(int world, const LocalPacket& local, const RayPacket& rays, const HitPacket& hits,
               ReturnRows& out) const;
  // Bit i: something lies on ray i before its tmax.
  [[nodiscard]] std::uint32_t occluded(int world, const RayFilter& filter, const RayPacket& rays,
                                       RayScratch& scratch) const;

  // One ray, for tests and tools. `direction` need not have length 1: t is in metres along it all
  // the same.
  [[nodiscard]] Hit trace(int world, const RayFilter& filter, const double origin[3],
                          const double direction[3]) const;

 private:
  const mjModel* model_;
  std::unique_ptr<SharedGeometry> shared_;
  const RayKernels* kernels_;
  std::vector<RayWorld> worlds_;
};

}  // namespace mjsense
