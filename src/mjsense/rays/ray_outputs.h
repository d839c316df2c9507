// SPDX-License-Identifier: Apache-2.0
#pragma once
// Converts a packet's hits to sensor outputs. Part of the kernels (kernels_impl.h), because as
// scalar code it took half of a lidar's time.

#include "mjsense/core/simd.h"
#include "mjsense/rays/packet.h"

namespace mjsense::rays {
namespace {

// The elements of the geoms that were hit, -1 in other lanes. A gather reads geom 0 for the lanes
// without a hit, and a scene without geoms has none.
Int of_geoms(const int* elements, Mask hit, Int geom) {
  if (!any(hit)) return int_of(-1);
  return select(hit, gather(elements, select(hit, geom, int_of(0))), int_of(-1));
}

void rows(const RayPacket& rays, float nearest, float farthest, const int* bodies,
          const int* materials, HitPacket& hits, RayOutputs& out) {
  for (int k = 0; k < kPacket; k += kWidth) {
    const Float t = load(hits.t + k);
    const Int geom = select(t >= Float(nearest), load(hits.geom + k), int_of(-1));
    const Mask hit = ~less(geom, int_of(0));
    const Float cut = min(t, Float(farthest));
    store(hits.geom + k, geom);
    store(hits.t + k, cut);
    store(out.distance + k, select(hit, cut, Float(-1.0f)));
    const Float far = select(hit, cut, Float(0.0f));
    Float pos[3], normal[3];
    for (int i = 0; i < 3; ++i) {
      pos[i] = shifted(rays.origin[i], load(rays.o[i] + k) + rounded(far * load(rays.d[i] + k)));
      normal[i] = select(hit, load(hits.n[i] + k), Float(0.0f));
    }
    store_rows(out.pos + 3 * k, pos[0], pos[1], pos[2]);
    store_rows(out.normal + 3 * k, normal[0], normal[1], normal[2]);
    if (bodies == nullptr) continue;
    store(out.body + k, of_geoms(bodies, hit, geom));
    store(out.material + k, of_geoms(materials, hit, geom));
  }
}

void returns(const LocalPacket& local, const RayPacket& rays, const HitPacket& hits,
             const float* rgba, LidarReturns& out) {
  for (int k = 0; k < kPacket; k += kWidth) {
    const Int geom = load(hits.geom + k);
    const Mask hit = ~less(geom, int_of(0));
    const Float t = select(hit, load(hits.t + k), Float(0.0f));
    store_rows(out.point + 3 * k, t * load(local.d[0] + k), t * load(local.d[1] + k),
               t * load(local.d[2] + k));
    if (!any(hit)) {  // see of_geoms
      store(out.intensity + k, Float(0.0f));
      continue;
    }
    const auto part = [&](int i) { return rounded(load(rays.d[i] + k) * load(hits.n[i] + k)); };
    const Float cosine = abs(part(0) + part(1) + part(2));
    const Int at = select(hit, geom, int_of(0)) * int_of(4);
    const Float colour = gather(rgba, at) + gather(rgba + 1, at) + gather(rgba + 2, at);
    const Float seen = min(max(colour / Float(3.0f) * cosine, Float(0.0f)), Float(1.0f));
    store(out.intensity + k, select(hit, seen, Float(0.0f)));
  }
}

}  // namespace
}  // namespace mjsense::rays
