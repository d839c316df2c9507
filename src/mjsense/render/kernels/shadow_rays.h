// SPDX-License-Identifier: Apache-2.0
#pragma once
// Shadow rays: tests whether a geom lies between a point and a light. Part of the tile kernels.

#include "mjsense/render/kernels/mesh_horizons.h"
#include "mjsense/render/kernels/shadow_casters.h"

namespace mjsense::render {
namespace {

// Points to be lit and their rays to the light, camera frame: q = p + s d, s in (0, end).
struct alignas(64) LightRays {
  const float (*p)[kLanes];
  const float (*n)[kLanes];  // surface normals
  const int *geom, *face;    // as in Hits
  float d[3][kLanes];
  float end[kLanes];  // 1 for a light with a position; the distance in m for a directional light
};

// Rays from on or above a height field that rise more steeply than its steepest slope; they do not
// hit it again.
inline Mask leaves_ground(const rays::HeightField& field, Vec3f o, Vec3f d, Mask on_ground) {
  const Float level = sqrt(fma(d.x, d.x, d.y * d.y));
  return (on_ground | (splat(field.top) <= o.z)) & (level * splat(1.01f * field.steepest) < d.z);
}

inline std::uint32_t shadow_of_triangles(const View& view, int index, const LightRays& rays,
                                         std::uint32_t active) {
  const ViewGeom& g = view.geoms[index];
  const bool horizons = has_horizons(g) && !view.grid.orthographic;
  rays::EmbreeRays ray;
  alignas(64) int valid[kWidth];
  std::uint32_t dark = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f p{load(rays.p[0] + k), load(rays.p[1] + k), load(rays.p[2] + k)};
    const Vec3f d = to_geom(g.rot, {load(rays.d[0] + k), load(rays.d[1] + k), load(rays.d[2] + k)});
    const Vec3f foot = to_geom(g.rot, p - splat(g.pos));
    // Start slightly above the surface, so that rounding does not put it in its own shadow.
    const Int same = load(rays.geom + k);
    const Mask other = ~(same == int_of(index));
    const Vec3f n = to_geom(g.rot, {load(rays.n[0] + k), load(rays.n[1] + k), load(rays.n[2] + k)});
    const Float lift = select(other, splat(0.0f), splat(1e-4f) * max(splat(g.radius), abs(p.z)));
    const Vec3f o = along(foot, lift, n);
    const Interval inside = box(o, d, g.aabb, g.aabb + 3);
    const Float end = load(rays.end + k);
    Mask hit =
        mask_of(active >> k & kAllLanes) & (inside.enter < end) & (inside.exit > splat(0.0f));
    if (g.height_field) hit = hit & ~leaves_ground(*g.height_field, o, d, ~other);
    if (horizons && any(hit & ~other))
      hit = hit & ~leaves_mesh(g, rays.face + k, foot, n, d, lift, hit & ~other);
    if (!any(hit)) continue;
    store(valid, select(hit, int_of(-1), int_of(0)));
    // Lanes without a hit (the sky) have infinite coordinates, which must not be passed to Embree.
    const Float zero = splat(0.0f);
    store(ray.org_x, select(hit, o.x, zero));
    store(ray.org_y, select(hit, o.y, zero));
    store(ray.org_z, select(hit, o.z, zero));
    store(ray.dir_x, select(hit, d.x, zero));
    store(ray.dir_y, select(hit, d.y, zero));
    store(ray.dir_z, select(hit, d.z, zero));
    store(ray.tnear, zero);
    store(ray.tfar, select(hit, end, zero));
    store(ray.time, zero);
    store(reinterpret_cast<int*>(ray.mask), int_of(-1));
    store(reinterpret_cast<int*>(ray.flags), int_of(0));
    rays::embree_occluded(valid, static_cast<RTCScene>(shadow_bvh_of(g)), &ray, false, true);
    dark |= bits(hit & (load(ray.tfar) < zero)) << k;
  }
  return dark;
}

inline std::uint32_t shadow_of_geom(const View& view, int caster, const LightRays& rays,
                                    std::uint32_t active) {
  const ViewGeom& g = view.geoms[caster];
  if (has_triangles(g)) return shadow_of_triangles(view, caster, rays, active);
  std::uint32_t dark = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const std::uint32_t lanes = active >> k & kAllLanes;
    if (!lanes) continue;
    const Vec3f p{load(rays.p[0] + k), load(rays.p[1] + k), load(rays.p[2] + k)};
    const Vec3f o = to_geom(g.rot, p - splat(g.pos));
    const Vec3f d = to_geom(g.rot, {load(rays.d[0] + k), load(rays.d[1] + k), load(rays.d[2] + k)});
    const Int at = load(rays.geom + k), self = int_of(caster);
    const Mask other = ~(at == self);
    const Float end = load(rays.end + k);
    Mask barred;
    if (g.type == mjGEOM_PLANE) {
      barred = plane(g, o, d, true) < end;
      // mujoco_warp sees planes from their front only.
      if (view.warp.on) barred = barred & (d.z < splat(0.0f));
    } else {
      const Interval inside = solid(g, o, d);
      barred = (inside.enter < end) & (inside.exit > splat(1e-5f));
    }
    dark |= (bits(barred & other) & lanes) << k;
  }
  return dark;
}

// Lanes of `active` whose ray to the light is blocked by one of `casters`.
inline std::uint32_t in_shadow(const View& view, Casters& casters, const LightRays& rays,
                               std::uint32_t active) {
  if (casters.count == 0 || !active) return 0;
  std::uint32_t left = active;
  if (casters.hint >= 0) {
    const std::uint32_t dark = shadow_of_geom(view, casters.hint, rays, active);
    left &= ~dark;
    if (!left) return active;
    if (!dark) casters.hint = -1;
  }
  const LitWindow points = window_of(*casters.frame, rays.p, left, casters.error);
  int last = casters.hint;
  for (int i = 0; i < casters.count && left; i += kWidth) {
    std::uint32_t near = overlaps(casters.windows, i, points);
    for (; near && left; near &= near - 1) {
      const int k = i + __builtin_ctz(near);
      if (k >= casters.count) break;
      const int geom = casters.list[k];
      if (geom == last || geom == casters.hint) continue;
      last = geom;
      left &= ~shadow_of_geom(view, geom, rays, left);
      if (!left) casters.hint = geom;
    }
  }
  return active & ~left;
}

}  // namespace
}  // namespace mjsense::render
