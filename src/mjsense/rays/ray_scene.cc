// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/ray_scene.h"

#include <cmath>

#include "mjsense/rays/box_list.h"
#include "mjsense/rays/flex_shapes.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/shared_geometry.h"

namespace mjsense::rays {
namespace {

KernelFilter kernel_filter(const RayFilter& f) {
  using Backfaces = RayFilter::Backfaces;
  return {f.groups,
          f.exclude_body,
          f.transparent,
          f.backfaces != Backfaces::kHit,
          f.backfaces == Backfaces::kCull,
          f.hidden.empty() ? nullptr : f.hidden.data()};
}

KernelWorld kernel_world(const RayWorld& w) {
  const BoxList& boxes = w.boxes();
  return {w.geoms().data(),
          boxes.all(),
          boxes.box_of_geom(),
          boxes.blocks(),
          w.flags().data(),
          w.bodies().data(),
          w.flexes() ? w.flexes()->scenes() : nullptr};
}

}  // namespace

const RayKernels& kernels_for(Isa isa) {
  if constexpr (kHasAvx) {
    if (isa == Isa::kAvx512) return avx512_kernels();
    if (isa == Isa::kAvx2) return avx2_kernels();
  }
  return portable_kernels();
}

RayScratch::RayScratch(int num_objects)
    : stride_((num_objects + 2 * kPacket - 1) / kPacket * kPacket),
      candidates_(num_objects),
      boxes_(6 * static_cast<std::size_t>(stride_)),
      ids_(num_objects) {}

RayScene::RayScene(const mjModel* model, int num_worlds, Isa isa)
    : model_(model), shared_(std::make_unique<SharedGeometry>(model)), kernels_(&kernels_for(isa)) {
  worlds_.reserve(num_worlds);
  for (int w = 0; w < num_worlds; ++w) worlds_.emplace_back(model, *shared_);
}

RayScene::~RayScene() = default;

void RayScene::update(const World& world) { worlds_[world.id].update(world.model, world.data); }

void RayScene::to_world(const LocalPacket& local, const float rotation[9], float tmax,
                        RayPacket& rays) const {
  kernels_->to_world(local, rotation, tmax, rays);
}

void RayScene::gather(int world, const RayFilter& filter, const RayPacket& rays,
                      RayScratch& scratch) const {
  scratch.count =
      kernels_->gather(kernel_world(worlds_[world]), kernel_filter(filter), rays, scratch.data());
}

void RayScene::trace_candidates(int world, const RayFilter& filter, const RayPacket& rays,
                                HitPacket& hits, std::span<const RayCandidate> candidates) const {
  const KernelScene scene{shared_->mesh_scenes.data(), shared_->height_fields.data()};
  kernels_->trace(scene, kernel_world(worlds_[world]), kernel_filter(filter), rays, hits,
                  candidates.data(), static_cast<int>(candidates.size()));
}

void RayScene::cull(int world, const RayFilter& filter, std::span<const RayPacket> packets,
                    RayScratch& scratch) const {
  float* rows[6];
  for (int k = 0; k < 6; ++k) rows[k] = scratch.boxes_.data() + k * scratch.stride_;
  scratch.num_boxes_ =
      kernels_->cull(kernel_world(worlds_[world]), kernel_filter(filter), packets.data(),
                     static_cast<int>(packets.size()), rows, rows + 3, scratch.ids_.data());
}

void RayScene::trace_culled(int world, const RayFilter& filter, const RayPacket& rays,
                            HitPacket& hits, RayScratch& scratch) const {
  const float* rows[6];
  for (int k = 0; k < 6; ++k) rows[k] = scratch.boxes_.data() + k * scratch.stride_;
  const KernelBoxes boxes{{rows[0], rows[1], rows[2]},
                          {rows[3], rows[4], rows[5]},
                          scratch.ids_.data(),
                          scratch.num_boxes_};
  scratch.count = kernels_->gather_from(boxes, rays, scratch.data());
  trace_candidates(world, filter, rays, hits, scratch.candidates());
}

void RayScene::rows(int world, const RayPacket& rays, float nearest, float farthest, bool ids,
                    HitPacket& hits, RayOutputs& out) const {
  const RayWorld& w = worlds_[world];
  kernels_->rows(rays, nearest, farthest, ids ? w.bodies().data() : nullptr, w.materials().data(),
                 hits, out);
}

void RayScene::returns(int world, const LocalPacket& local, const RayPacket& rays,
                       const HitPacket& hits, LidarReturns& out) const {
  kernels_->returns(local, rays, hits, worlds_[world].rgba().data(), out);
}

void RayScene::trace(int world, const RayFilter& filter, const RayPacket& rays, HitPacket& hits,
                     RayScratch& scratch) const {
  gather(world, filter, rays, scratch);
  trace_candidates(world, filter, rays, hits, scratch.candidates());
}

Hit RayScene::trace(int world, const RayFilter& filter, const double origin[3],
                    const double direction[3]) const {
  RayScratch scratch(num_objects());
  RayPacket rays{};
  HitPacket hits;
  const double length = std::sqrt(direction[0] * direction[0] + direction[1] * direction[1] +
                                  direction[2] * direction[2]);
  for (int k = 0; k < 3; ++k) {
    rays.origin[k] = origin[k];
    for (int i = 0; i < kPacket; ++i) rays.d[k][i] = static_cast<float>(direction[k] / length);
  }
  for (int i = 0; i < kPacket; ++i) rays.tmax[i] = i == 0 ? kNoHit : -1.0f;
  trace(world, filter, rays, hits, scratch);
  return {hits.t[0], hits.geom[0], hits.prim[0], {hits.n[0][0], hits.n[1][0], hits.n[2][0]},
          hits.u[0], hits.v[0]};
}

}  // namespace mjsense::rays
