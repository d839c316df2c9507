#pragma once
// Which geom each pixel of a packet sees first, and what lies between a point and a light. Part of
// the tile kernels.

#include "mjsense/render/kernel_rays.h"

namespace mjsense {
namespace {

inline bool overlap(const float* a, const float* b) {
  return a[0] <= b[1] && b[0] <= a[1] && a[2] <= b[3] && b[2] <= a[3];
}

// Is any of the packet's hits beyond `depth`?
inline bool any_beyond(const float* t, float depth) {
  for (int k = 0; k < kLanes; k += kWidth)
    if (any(splat(depth) < load(t + k))) return true;
  return false;
}

// Surfaces nearer to each other than this (times t) coincide: the geom with the higher id shows, as
// MuJoCo draws it later. (Rays, like mj_ray, take the lower one.)
constexpr float kSame = 3e-7f;

// Lanes where a hit at t on geom `id` replaces what was there before.
inline Mask shows(Float t, Int id, Float before, Int id_before) {
  const Float slack = t * splat(kSame);
  return (t < splat(kInfinity)) &
         ((t < before - slack) | ((t <= before + slack) & less(id_before, id)));
}

// Lanes whose ray meets the geom's bounding box before t, as Embree takes them; false if there are
// none.
inline bool fill_rays(const ViewGeom& g, const PixelGrid& grid, const Pixels& pixels,
                      const float* t, RTCRayHit16& rays, int* valid) {
  std::uint32_t some = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const LocalRay ray = pixel_ray(g, grid, load(pixels.x + k), load(pixels.y + k));
    const Interval inside = box(ray.o, ray.d, g.box, g.box + 3);
    const Float limit = load(t + k) * splat(1.0f + kSame);
    const Mask hit = (inside.enter < limit) & (inside.exit > load(pixels.near + k));
    some |= bits(hit);
    store(valid + k, select(hit, int_of(-1), int_of(0)));
    store(rays.ray.org_x + k, ray.o.x);
    store(rays.ray.org_y + k, ray.o.y);
    store(rays.ray.org_z + k, ray.o.z);
    store(rays.ray.dir_x + k, ray.d.x);
    store(rays.ray.dir_y + k, ray.d.y);
    store(rays.ray.dir_z + k, ray.d.z);
    store(rays.ray.tnear + k, load(pixels.near + k));
    store(rays.ray.tfar + k, limit);
    store(rays.ray.time + k, splat(0.0f));
    store(reinterpret_cast<int*>(rays.ray.mask) + k, int_of(-1));
    store(reinterpret_cast<int*>(rays.ray.flags) + k, int_of(0));
    store(reinterpret_cast<int*>(rays.hit.geomID) + k, int_of(-1));
    store(reinterpret_cast<int*>(rays.hit.instID[0]) + k, int_of(-1));
  }
  return some != 0;
}

inline void trace_triangles(const ViewGeom& g, int index, const PixelGrid& grid,
                            const Pixels& pixels, Hits& hits) {
  RTCRayHit16 rays;
  alignas(64) int valid[kLanes];
  if (!fill_rays(g, grid, pixels, hits.t, rays, valid)) return;
  embree_intersect16(valid, static_cast<RTCScene>(g.bvh), &rays, false, true);
  // A closed surface shows its front first. Only where a back came first is it worth to ask Embree
  // about every triangle's side.
  std::uint32_t backs = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f n{load(rays.hit.Ng_x + k), load(rays.hit.Ng_y + k), load(rays.hit.Ng_z + k)};
    const Vec3f d{load(rays.ray.dir_x + k), load(rays.ray.dir_y + k), load(rays.ray.dir_z + k)};
    int* ids = reinterpret_cast<int*>(rays.hit.geomID) + k;
    const Mask back = less(int_of(-1), load(ids)) & (dot(n, d) > splat(0.0f));
    backs |= bits(back) << k;
    store(valid + k, select(back, int_of(-1), int_of(0)));
    store(ids, select(back, int_of(-1), load(ids)));
    const Float limit = load(hits.t + k) * splat(1.0f + kSame);
    store(rays.ray.tfar + k, select(back, limit, load(rays.ray.tfar + k)));
  }
  if (backs) embree_intersect16(valid, static_cast<RTCScene>(g.bvh), &rays, true, true);
  for (int k = 0; k < kLanes; k += kWidth) {
    const Float t = load(rays.ray.tfar + k);
    const Float before = load(hits.t + k);
    const Int found = load(reinterpret_cast<int*>(rays.hit.geomID) + k);
    const Mask hit = less(int_of(-1), found) & shows(t, int_of(g.id), before, load(hits.id + k));
    if (!any(hit)) continue;
    store(hits.id + k, select(hit, int_of(g.id), load(hits.id + k)));
    store(hits.t + k, select(hit, t, before));
    store(hits.geom + k, select(hit, int_of(index), load(hits.geom + k)));
    store(hits.prim + k,
          select(hit, load(reinterpret_cast<int*>(rays.hit.primID) + k), load(hits.prim + k)));
    store(hits.u + k, select(hit, load(rays.hit.u + k), load(hits.u + k)));
    store(hits.v + k, select(hit, load(rays.hit.v + k), load(hits.v + k)));
    store(hits.n[0] + k, select(hit, load(rays.hit.Ng_x + k), load(hits.n[0] + k)));
    store(hits.n[1] + k, select(hit, load(rays.hit.Ng_y + k), load(hits.n[1] + k)));
    store(hits.n[2] + k, select(hit, load(rays.hit.Ng_z + k), load(hits.n[2] + k)));
  }
}

// Side walls and base of a height field, from outside. Few rays meet them: one lane at a time.
inline void trace_walls(const ViewGeom& g, int index, const PixelGrid& grid, const Pixels& pixels,
                        Hits& hits) {
  const HeightField& f = *g.height_field;
  const float center[3] = {0, 0, 0.5f * (f.size[2] - f.size[3])};
  const float half[3] = {f.size[0], f.size[1], 0.5f * (f.size[2] + f.size[3])};
  for (int k = 0; k < kLanes; k += kWidth) {
    const LocalRay ray = pixel_ray(g, grid, load(pixels.x + k), load(pixels.y + k));
    const Interval inside = box(ray.o, ray.d, center, half);
    const Mask hit = (inside.enter < load(hits.t + k)) & (load(pixels.near + k) < inside.enter) &
                     (inside.enter <= inside.exit);
    const std::uint32_t lanes = bits(hit);
    if (!lanes) continue;
    alignas(64) float t[kWidth], p[3][kWidth];
    const Vec3f at = along(ray.o, inside.enter, ray.d);
    store(t, inside.enter);
    store(p[0], at.x);
    store(p[1], at.y);
    store(p[2], at.z);
    for (int i = 0; i < kWidth; ++i) {
      if (!(lanes >> i & 1u)) continue;
      const float x = p[0][i] / f.size[0], y = p[1][i] / f.size[1];
      const float z = (p[2][i] - center[2]) / half[2];
      const float ax = x < 0 ? -x : x, ay = y < 0 ? -y : y, az = z < 0 ? -z : z;
      const bool vertical = az > ax && az > ay;
      if (vertical && z > 0) continue;  // entered through the open top
      const float column = 0.5f * (x + 1) * (f.cols - 1), row = 0.5f * (y + 1) * (f.rows - 1);
      if (!vertical && p[2][i] > border_height(f, column, row)) continue;
      hits.t[k + i] = t[i];
      hits.id[k + i] = g.id;
      hits.geom[k + i] = index;
      hits.prim[k + i] = -1;
      hits.n[0][k + i] = vertical ? 0.0f : ax >= ay ? x : 0.0f;
      hits.n[1][k + i] = vertical || ax >= ay ? 0.0f : y;
      hits.n[2][k + i] = vertical ? -1.0f : 0.0f;
    }
  }
}

// Nearer hits of the packet on geom `index` replace those in `hits`. Front faces only.
inline void trace_geom(const View& view, int index, const Pixels& pixels, Hits& hits) {
  const ViewGeom& g = view.geoms[index];
  if (g.bvh) {
    trace_triangles(g, index, view.grid, pixels, hits);
    if (g.height_field) trace_walls(g, index, view.grid, pixels, hits);
    return;
  }
  for (int k = 0; k < kLanes; k += kWidth) {
    const LocalRay ray = pixel_ray(g, view.grid, load(pixels.x + k), load(pixels.y + k));
    const Float t =
        g.type == mjGEOM_PLANE ? plane(g, ray.o, ray.d, g.behind) : solid(g, ray.o, ray.d).enter;
    const Float before = load(hits.t + k);
    const Mask hit =
        shows(t, int_of(g.id), before, load(hits.id + k)) & (load(pixels.near + k) < t);
    if (!any(hit)) continue;
    store(hits.id + k, select(hit, int_of(g.id), load(hits.id + k)));
    store(hits.t + k, select(hit, t, before));
    store(hits.geom + k, select(hit, int_of(index), load(hits.geom + k)));
  }
}

inline void clear(Hits& hits, float far) {
  const Float zero = splat(0.0f);
  for (int k = 0; k < kLanes; k += kWidth) {
    store(hits.t + k, splat(far));
    store(hits.id + k, int_of(-1));
    store(hits.geom + k, int_of(-1));
    store(hits.prim + k, int_of(-1));
    store(hits.u + k, zero);
    store(hits.v + k, zero);
    for (auto& n : hits.n) store(n + k, zero);
  }
}

// The nearest opaque geoms among `list`, which is sorted by ViewGeom::nearest.
// No list: all that are in sight.
inline void trace_packet(const View& view, const int* list, int count, const Pixels& pixels,
                         Hits& hits) {
  for (int i = 0; i < count; ++i) {
    const int index = list ? list[i] : i;
    const ViewGeom& g = view.geoms[index];
    if (!any_beyond(hits.t, g.nearest)) break;
    if (overlap(g.window, pixels.window)) trace_geom(view, index, pixels, hits);
  }
}

// Points to be lit, camera frame, and the way to the light: q = p + s d, s in (0, end).
struct alignas(64) LightRays {
  float p[3][kLanes], d[3][kLanes], n[3][kLanes];
  float end[kLanes];  // 1 for a light at a place; how far it is for a direction
  int geom[kLanes];
  // Scalars come last: what is above is loaded as aligned vectors.
  float longest;            // the largest end
  float center[3], radius;  // sphere around the active points
};

// Can anything within `radius` around `center` lie between the packet's points and the light?
inline bool in_shaft(const LightRays& rays, const float* axis, const ViewGeom& g) {
  if (g.type == mjGEOM_PLANE) return true;
  const float v[3] = {g.center[0] - rays.center[0], g.center[1] - rays.center[1],
                      g.center[2] - rays.center[2]};
  const float length2 = axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2];
  float s = (v[0] * axis[0] + v[1] * axis[1] + v[2] * axis[2]) / length2;
  s = s < 0 ? 0 : s > rays.longest ? rays.longest : s;
  const float w[3] = {v[0] - s * axis[0], v[1] - s * axis[1], v[2] - s * axis[2]};
  const float reach = g.radius + rays.radius;
  return w[0] * w[0] + w[1] * w[1] + w[2] * w[2] <= reach * reach;
}

inline std::uint32_t shadow_of_triangles(const ViewGeom& g, int index, const LightRays& rays,
                                         std::uint32_t active) {
  RTCRay16 ray;
  alignas(64) int valid[kLanes];
  std::uint32_t some = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const Vec3f p{load(rays.p[0] + k), load(rays.p[1] + k), load(rays.p[2] + k)};
    const Vec3f d = to_geom(g.rot, {load(rays.d[0] + k), load(rays.d[1] + k), load(rays.d[2] + k)});
    Vec3f o = to_geom(g.rot, p - splat(g.pos));
    // A surface must not lie in its own shadow by rounding: start a little above it.
    const Int same = load(rays.geom + k);
    const Mask other = less(same, int_of(index)) | less(int_of(index), same);
    const Vec3f n = to_geom(g.rot, {load(rays.n[0] + k), load(rays.n[1] + k), load(rays.n[2] + k)});
    const Float lift = select(other, splat(0.0f), splat(1e-4f) * max(splat(g.radius), abs(p.z)));
    o = along(o, lift, n);
    const Interval inside = box(o, d, g.box, g.box + 3);
    const Mask hit = mask_of(active >> k & kAllLanes) & (inside.enter < load(rays.end + k)) &
                     (inside.exit > splat(0.0f));
    some |= bits(hit);
    store(valid + k, select(hit, int_of(-1), int_of(0)));
    store(ray.org_x + k, o.x);
    store(ray.org_y + k, o.y);
    store(ray.org_z + k, o.z);
    store(ray.dir_x + k, d.x);
    store(ray.dir_y + k, d.y);
    store(ray.dir_z + k, d.z);
    store(ray.tnear + k, splat(0.0f));
    store(ray.tfar + k, load(rays.end + k));
    store(ray.time + k, splat(0.0f));
    store(reinterpret_cast<int*>(ray.mask) + k, int_of(-1));
    store(reinterpret_cast<int*>(ray.flags) + k, int_of(0));
  }
  if (!some) return 0;
  embree_occluded16(valid, static_cast<RTCScene>(g.bvh), &ray, false);
  std::uint32_t dark = 0;
  for (int i = 0; i < kLanes; ++i)
    if (valid[i] && ray.tfar[i] < 0) dark |= 1u << i;
  return dark;
}

inline std::uint32_t shadow_of_geom(const View& view, int caster, const LightRays& rays,
                                    std::uint32_t active) {
  const ViewGeom& g = view.geoms[caster];
  if (g.bvh) return shadow_of_triangles(g, caster, rays, active);
  std::uint32_t dark = 0;
  for (int k = 0; k < kLanes; k += kWidth) {
    const std::uint32_t lanes = active >> k & kAllLanes;
    if (!lanes) continue;
    const Vec3f p{load(rays.p[0] + k), load(rays.p[1] + k), load(rays.p[2] + k)};
    const Vec3f o = to_geom(g.rot, p - splat(g.pos));
    const Vec3f d = to_geom(g.rot, {load(rays.d[0] + k), load(rays.d[1] + k), load(rays.d[2] + k)});
    const Int at = load(rays.geom + k), self = int_of(caster);
    const Mask other = less(at, self) | less(self, at);
    const Float end = load(rays.end + k);
    Mask barred;
    if (g.type == mjGEOM_PLANE) {
      barred = plane(g, o, d, true) < end;
    } else {
      const Interval inside = solid(g, o, d);
      barred = (inside.enter < end) & (inside.exit > splat(1e-5f));
    }
    dark |= (bits(barred & other) & lanes) << k;
  }
  return dark;
}

// Geoms that may stand between a light and the points at hand. `hint`: the one that did for the
// packet before; it is asked first, which changes nothing but the time.
struct Casters {
  const int* list;
  int count;
  int hint;
};

// Lanes of `active` whose way to the light is barred by one of `casters`.
inline std::uint32_t in_shadow(const View& view, Casters& casters, const LightRays& rays,
                               const float* axis, std::uint32_t active) {
  if (casters.count == 0) return 0;
  std::uint32_t left = active;
  if (in_shaft(rays, axis, view.geoms[casters.list[casters.hint]]))
    left &= ~shadow_of_geom(view, casters.list[casters.hint], rays, left);
  for (int i = 0; i < casters.count && left; ++i) {
    if (i == casters.hint || !in_shaft(rays, axis, view.geoms[casters.list[i]])) continue;
    const std::uint32_t dark = shadow_of_geom(view, casters.list[i], rays, left);
    if (!dark) continue;
    left &= ~dark;
    if (!left) casters.hint = i;
  }
  return active & ~left;
}

}  // namespace
}  // namespace mjsense
