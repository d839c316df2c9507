// SPDX-License-Identifier: Apache-2.0
#pragma once
// What lies between a point and a light. Part of the tile kernels.

#include "mjsense/render/kernels/rays.h"

namespace mjsense {
namespace {

// Points to be lit, camera frame, and the way to the light: q = p + s d, s in (0, end).
struct alignas(64) LightRays {
  float p[3][kLanes], d[3][kLanes], n[3][kLanes];
  float end[kLanes];  // 1 for a light at a place; how far it is for a direction
  int geom[kLanes];
};

// What lies between points around `center` and a light: all within `radius` of center + s axis, s
// in [0, longest].
struct Shaft {
  float center[3], axis[3];
  float radius, longest;
  float inverse_length2;  // of axis
};

// `low`, `high`: box around the points.
inline Shaft shaft_to(const ViewLight& light, const float* low, const float* high, float longest) {
  Shaft shaft;
  const bool directional = light.kind == LightKind::kDirectional;
  float r2 = 0, l2 = 0;
  for (int c = 0; c < 3; ++c) {
    shaft.center[c] = 0.5f * (low[c] + high[c]);
    shaft.axis[c] = directional ? -light.dir[c] : light.pos[c] - shaft.center[c];
    r2 += 0.25f * (high[c] - low[c]) * (high[c] - low[c]);
    l2 += shaft.axis[c] * shaft.axis[c];
  }
  shaft.radius = __builtin_sqrtf(r2);
  shaft.longest = longest;
  shaft.inverse_length2 = 1.0f / (l2 > kTiny ? l2 : kTiny);
  return shaft;
}

// Bounding spheres from `first` on that reach into the shaft: a bit for each of kWidth.
inline std::uint32_t spheres_in_shaft(const Shaft& shaft, const Spheres& spheres, int first) {
  const Vec3f axis = splat(shaft.axis);
  const Vec3f v =
      Vec3f{loadu(spheres.x + first), loadu(spheres.y + first), loadu(spheres.z + first)} -
      splat(shaft.center);
  const Float s = dot(v, axis) * splat(shaft.inverse_length2);
  const Vec3f away = along(v, -min(max(s, splat(0.0f)), splat(shaft.longest)), axis);
  const Float reach = loadu(spheres.radius + first) + splat(shaft.radius);
  return bits(dot(away, away) <= reach * reach);
}

// Does the shaft come near the geom's bounding box?
inline bool meets_box(const Shaft& shaft, const ViewGeom& g) {
  const float* r = g.rot;
  const float v[3] = {shaft.center[0] - g.pos[0], shaft.center[1] - g.pos[1],
                      shaft.center[2] - g.pos[2]};
  float enter = 0, exit = shaft.longest;
  for (int i = 0; i < 3; ++i) {
    const float o = r[i] * v[0] + r[3 + i] * v[1] + r[6 + i] * v[2] - g.box[i];
    const float d = r[i] * shaft.axis[0] + r[3 + i] * shaft.axis[1] + r[6 + i] * shaft.axis[2];
    const float half = g.box[3 + i] + shaft.radius;
    const float inverse = 1.0f / (d < kTiny && d > -kTiny ? kTiny : d);
    const float a = (-half - o) * inverse, b = (half - o) * inverse;
    const float first = a < b ? a : b, last = a < b ? b : a;
    enter = first > enter ? first : enter;
    exit = last < exit ? last : exit;
  }
  return enter <= exit;
}

// Rays from on or above a height field that climb more steeply than it does anywhere: they do not
// come back to it.
inline Mask leaves_ground(const HeightField& field, Vec3f o, Vec3f d, Mask on_ground) {
  const Float level = sqrt(fma(d.x, d.x, d.y * d.y));
  return (on_ground | (splat(field.top) <= o.z)) & (level * splat(1.01f * field.steepest) < d.z);
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
    Mask hit = mask_of(active >> k & kAllLanes) & (inside.enter < load(rays.end + k)) &
               (inside.exit > splat(0.0f));
    if (g.height_field) hit = hit & ~leaves_ground(*g.height_field, o, d, ~other);
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

// Geoms that may stand between a light and the points at hand, with their bounding spheres. `hint`:
// the one that did for the packet before, or -1; it is asked first, which changes nothing but the
// time.
struct Casters {
  int* list;
  Spheres spheres;
  int count;
  int hint;

  void add(const View& view, int g) {
    list[count] = g;
    spheres.x[count] = view.spheres.x[g];
    spheres.y[count] = view.spheres.y[g];
    spheres.z[count] = view.spheres.z[g];
    spheres.radius[count++] = view.spheres.radius[g];
  }
};

// All casters of one light among `part` for points in a box.
inline void find_casters(const View& view, const ViewLight& light, Part part, const float* low,
                         const float* high, Casters& out) {
  const bool directional = light.kind == LightKind::kDirectional;
  const Shaft shaft = shaft_to(light, low, high, directional ? kInfinity : 1.0f);
  for (int i = 0; i < view.num_geoms; i += kWidth) {
    std::uint32_t near = spheres_in_shaft(shaft, view.spheres, i);
    for (; near; near &= near - 1) {
      const int g = i + __builtin_ctz(near);
      if (g >= view.num_geoms) break;
      const ViewGeom& geom = view.geoms[g];
      if (!belongs(geom, part)) continue;
      if (geom.type == mjGEOM_PLANE || meets_box(shaft, geom)) out.add(view, g);
    }
  }
}

// Lanes of `active` whose way to the light is barred by one of `casters`.
inline std::uint32_t in_shadow(const View& view, Casters& casters, const LightRays& rays,
                               const Shaft& shaft, std::uint32_t active) {
  if (casters.count == 0 || !active) return 0;
  std::uint32_t left = active;
  if (casters.hint >= 0) {
    const std::uint32_t dark = shadow_of_geom(view, casters.list[casters.hint], rays, active);
    left &= ~dark;
    if (!dark) casters.hint = -1;
  }
  for (int i = 0; i < casters.count && left; i += kWidth) {
    std::uint32_t near = spheres_in_shaft(shaft, casters.spheres, i);
    for (; near && left; near &= near - 1) {
      const int k = i + __builtin_ctz(near);
      if (k >= casters.count) break;
      if (k == casters.hint) continue;
      left &= ~shadow_of_geom(view, casters.list[k], rays, left);
      if (!left) casters.hint = k;
    }
  }
  return active & ~left;
}

}  // namespace
}  // namespace mjsense
