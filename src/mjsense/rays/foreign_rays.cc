// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/foreign_rays.h"

#include <algorithm>
#include <cmath>

#include "mjsense/worlds/ordered_apply.h"

namespace mjsense::rays {
namespace {

constexpr int kChunk = 12;  // packets that are culled together

bool finite(const float* v) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

}  // namespace

ForeignRays::ForeignRays(const worlds::Worlds& worlds)
    : scene_(worlds.model(), worlds.size()),
      pool_(worlds.threads()),
      scratch_(pool_.size(), RayScratch(scene_.num_objects())) {}

void ForeignRays::update(worlds::Worlds& worlds, const Also& also) {
  struct Pass {
    RayScene* scene;
    const Also* also;
  } pass{&scene_, &also};
  worlds::apply_ordered(
      worlds.batch(), nullptr, 0,
      [](const mjModel* m, mjData* d, int w, void* argument) {
        const auto& [scene, also] = *static_cast<const Pass*>(argument);
        World world{};
        world.id = w;
        world.model = m;
        world.data = d;
        scene->update(world);
        if (*also) (*also)(m, w);
      },
      &pass, 0);
}

void ForeignRays::cast(worlds::Worlds& worlds, const ForeignRaysQuery& query) {
  update(worlds);
  const int packets = (query.count + kPacket - 1) / kPacket,
            chunks = (packets + kChunk - 1) / kChunk;
  pool_.run_near(worlds.size() * chunks, [&](int item, int thread) {
    const int begin = item % chunks * kChunk;
    cast_packets(item / chunks, begin, std::min(begin + kChunk, packets), query, scratch_[thread]);
  });
}

void ForeignRays::cast_packets(int world, int begin, int end, const ForeignRaysQuery& query,
                               RayScratch& scratch) const {
  RayPacket packets[kChunk];
  float lengths[kChunk][kPacket];
  const std::size_t row = static_cast<std::size_t>(world) * query.count;
  // Packets that are culled together need the same origin.
  const float* origin = query.origins + 3 * (row + static_cast<std::size_t>(begin) * kPacket);
  const int rays = std::min(end * kPacket, query.count) - begin * kPacket;
  for (int i = 1; i < rays && !finite(origin); ++i) origin += 3;
  for (int p = begin; p < end; ++p) {
    RayPacket& packet = packets[p - begin];
    const std::size_t first = row + static_cast<std::size_t>(p) * kPacket;
    std::copy_n(origin, 3, packet.origin);
    for (int lane = 0; lane < kPacket; ++lane) {
      const bool there = p * kPacket + lane < query.count;
      const std::size_t ray = there ? first + lane : first;
      const float *o = query.origins + 3 * ray, *v = query.directions + 3 * ray;
      const double length =
          std::sqrt(double{v[0]} * v[0] + double{v[1]} * v[1] + double{v[2]} * v[2]);
      const bool traced = there && length > 0 && finite(o) && finite(v);
      for (int k = 0; k < 3; ++k) {
        packet.o[k][lane] = traced ? static_cast<float>(o[k] - packet.origin[k]) : 0.0f;
        packet.d[k][lane] = traced ? static_cast<float>(v[k] / length) : (k == 0 ? 1.0f : 0.0f);
      }
      lengths[p - begin][lane] = static_cast<float>(length);
      packet.tmax[lane] = traced ? 1e10f : -1.0f;
    }
  }
  // Rays of a chunk mostly exclude the same body: each body has a pass.
  for (int p = begin; p < end;) {
    RayFilter filter;
    filter.groups = query.groups;
    filter.hidden = query.hidden;
    filter.exclude_body = query.exclude[p * kPacket];
    int last = p;
    const auto same = [&](int packet) {
      const int from = packet * kPacket, to = std::min(from + kPacket, query.count);
      return std::all_of(query.exclude + from, query.exclude + to,
                         [&](int body) { return body == filter.exclude_body; });
    };
    while (last < end && same(last)) ++last;
    HitPacket hits;
    if (last > p) {
      scene_.cull(world, filter, {packets + (p - begin), static_cast<std::size_t>(last - p)},
                  scratch);
    }
    const bool mixed = last == p;
    if (mixed) last = p + 1;
    for (; p < last; ++p) {
      const RayPacket& packet = packets[p - begin];
      if (!mixed) scene_.trace_culled(world, filter, packet, hits, scratch);
      for (int lane = 0; lane < kPacket && p * kPacket + lane < query.count; ++lane) {
        const std::size_t ray = row + p * kPacket + lane;
        float t = hits.t[lane], n[3] = {hits.n[0][lane], hits.n[1][lane], hits.n[2][lane]};
        int geom = mixed ? -1 : hits.geom[lane];
        if (mixed && packet.tmax[lane] > 0) {
          filter.exclude_body = query.exclude[p * kPacket + lane];
          const float *o = query.origins + 3 * ray, *v = query.directions + 3 * ray;
          const double origin[3] = {o[0], o[1], o[2]}, direction[3] = {v[0], v[1], v[2]};
          const Hit hit = scene_.trace(world, filter, origin, direction);
          geom = hit.geom;
          t = static_cast<float>(hit.t);
          std::copy_n(hit.normal.data(), 3, n);
        }
        query.geoms[ray] = geom;
        query.distances[ray] = geom >= 0 ? t / lengths[p - begin][lane] : -1.0f;
        for (int k = 0; k < 3; ++k) query.normals[3 * ray + k] = geom >= 0 ? n[k] : 0.0f;
      }
    }
  }
}

}  // namespace mjsense::rays
