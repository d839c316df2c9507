// SPDX-License-Identifier: Apache-2.0
#pragma once
// Finds the nearest geom for the pixels of packets by casting rays. Part of the tile kernels.

#include "mjsense/render/kernels/mesh_parts.h"
#include "mjsense/render/kernels/rays.h"

namespace mjsense::render {
namespace {

inline bool overlap(const float* a, const float* b) {
  return a[0] <= b[1] && b[0] <= a[1] && a[2] <= b[3] && b[2] <= a[3];
}

// Two hits coincide if their distance is less than this times t. The geom with the higher id is
// shown, as MuJoCo draws it later. (Rays, like mj_ray, take the lower id.)
constexpr float kSame = 3e-7f;

// Lanes where a hit at t on geom `id` replaces the earlier hit.
inline Mask shows(Float t, Int id, Float before, Int id_before) {
  const Float slack = t * splat(kSame);
  return (t < splat(kInfinity)) &
         ((t < before - slack) | ((t <= before + slack) & less(id_before, id)));
}

// Bit q: packet q of a tile.
using PacketMask = std::uint32_t;

constexpr int kPackets = kTileSize / 4;  // along one side of a tile
constexpr int kTilePackets = kPackets * kPackets;
static_assert(kTilePackets == kLanes, "a vector has a lane for each packet");

class KeptTriangles;

struct alignas(64) Tile {
  Pixels pixels[kTilePackets];
  Hits hits[kTilePackets];
  // Per packet: Pixels::window, and the largest t of its hits (minus infinity: unused packet).
  float window[4][kTilePackets];
  float farthest[kTilePackets];
  float around[4];  // union of all windows
  float depth;      // maximum of `farthest`
  bool regular;     // the pixels are on the view's grid
  bool shaded;      // outputs other than depth and ids are requested
  // If `keep` is not null, the triangles that are set up are kept there, with those within `reach`.
  KeptTriangles* keep;
  float reach[4];
  const KeptTriangles* kept;  // null, or triangles that need not be set up again
};

// Packets that may see something in `window`, at `nearest` or farther, in front of their hits.
inline PacketMask packets_in_reach(const float* window, float nearest, const Tile& tile) {
  PacketMask packets = 0;
  for (int k = 0; k < kTilePackets; k += kWidth) {
    const Mask m = (load(tile.window[0] + k) <= splat(window[1])) &
                   (splat(window[0]) <= load(tile.window[1] + k)) &
                   (load(tile.window[2] + k) <= splat(window[3])) &
                   (splat(window[2]) <= load(tile.window[3] + k)) &
                   (splat(nearest) < load(tile.farthest + k));
    packets |= bits(m) << k;
  }
  return packets;
}

// Constants for tracing one geom. Packets are independent of each other, so the CPU can overlap
// work on several.
struct Tracing {
  const ViewGeom& geom;
  int index;  // of the geom in the view
  bool orthographic;
  Vec3f eye, right, up, ahead;  // of the camera, in the geom's frame

  Tracing(const View& view, int i)
      : geom(view.geoms[i]), index(i), orthographic(view.grid.orthographic), eye(splat(geom.eye)) {
    const float* r = geom.rot;
    right = {splat(r[0]), splat(r[1]), splat(r[2])};
    up = {splat(r[3]), splat(r[4]), splat(r[5])};
    ahead = {splat(-r[6]), splat(-r[7]), splat(-r[8])};
  }
  LocalRay ray(const Pixels& pixels, int k) const {
    const Float x = load(pixels.x + k), y = load(pixels.y + k);
    if (orthographic) return {along(along(eye, x, right), y, up), ahead};
    return {eye, along(along(ahead, x, right), y, up)};
  }
};

// Writes the rays of kWidth pixels from k on for Embree. Only rays that meet the geom's bounding
// box before `limit` are valid; returns false if there are none.
inline bool fill_rays(const Tracing& at, const Pixels& pixels, int k, Float limit,
                      rays::EmbreeRayHits& rays, int* valid) {
  const ViewGeom& g = at.geom;
  const LocalRay ray = at.ray(pixels, k);
  const Interval inside = box(ray.o, ray.d, g.aabb, g.aabb + 3);
  const Float near = load(pixels.near + k);
  const Mask hit = (inside.enter < limit) & (inside.exit > near);
  if (!any(hit)) return false;
  store(valid, select(hit, int_of(-1), int_of(0)));
  store(rays.ray.org_x, ray.o.x);
  store(rays.ray.org_y, ray.o.y);
  store(rays.ray.org_z, ray.o.z);
  store(rays.ray.dir_x, ray.d.x);
  store(rays.ray.dir_y, ray.d.y);
  store(rays.ray.dir_z, ray.d.z);
  store(rays.ray.tnear, near);
  store(rays.ray.tfar, limit);
  store(reinterpret_cast<int*>(rays.hit.geomID), int_of(-1));
  return true;
}

// The first hit on a closed surface is a front face. Only lanes whose first hit is a back face are
// traced again with Embree's filter that tests the side of every triangle.
inline void trace_past_back_faces(const ViewGeom& g, Float limit, rays::EmbreeRayHits& rays,
                                  int* valid) {
  const Vec3f n{load(rays.hit.Ng_x), load(rays.hit.Ng_y), load(rays.hit.Ng_z)};
  const Vec3f d{load(rays.ray.dir_x), load(rays.ray.dir_y), load(rays.ray.dir_z)};
  int* ids = reinterpret_cast<int*>(rays.hit.geomID);
  const Mask back = less(int_of(-1), load(ids)) & (dot(n, d) > splat(0.0f));
  if (!any(back)) return;
  store(valid, select(back, int_of(-1), int_of(0)));
  store(ids, select(back, int_of(-1), load(ids)));
  store(rays.ray.tfar, select(back, limit, load(rays.ray.tfar)));
  rays::embree_intersect(valid, static_cast<RTCScene>(bvh_of(g)), &rays, true, true);
}

inline PacketMask trace_triangles(const Tracing& at, const Pixels* pixels, Hits* hits,
                                  PacketMask packets) {
  const ViewGeom& g = at.geom;
  rays::EmbreeRayHits rays;
  alignas(64) int valid[kWidth];
  // Embree does not change these fields.
  store(rays.ray.time, splat(0.0f));
  store(reinterpret_cast<int*>(rays.ray.mask), int_of(-1));
  store(reinterpret_cast<int*>(rays.ray.flags), int_of(0));
  store(reinterpret_cast<int*>(rays.hit.instID[0]), int_of(-1));
  PacketMask changed = 0;
  for (; packets; packets &= packets - 1) {
    const int q = __builtin_ctz(packets);
    Hits& h = hits[q];
    for (int k = 0; k < kLanes; k += kWidth) {
      const Float before = load(h.t + k), limit = before * splat(1.0f + kSame);
      if (!fill_rays(at, pixels[q], k, limit, rays, valid)) continue;
      rays::embree_intersect(valid, static_cast<RTCScene>(bvh_of(g)), &rays, false, true);
      trace_past_back_faces(g, limit, rays, valid);
      const Float t = load(rays.ray.tfar);
      const Int found = load(reinterpret_cast<int*>(rays.hit.geomID));
      const Mask hit = less(int_of(-1), found) & shows(t, int_of(g.id), before, load(h.id + k));
      if (!any(hit)) continue;
      changed |= 1u << q;
      store(h.id + k, select(hit, int_of(g.id), load(h.id + k)));
      store(h.t + k, select(hit, t, before));
      store(h.geom + k, select(hit, int_of(at.index), load(h.geom + k)));
      store(h.prim + k,
            select(hit, load(reinterpret_cast<int*>(rays.hit.primID)), load(h.prim + k)));
      store(h.u + k, select(hit, load(rays.hit.u), load(h.u + k)));
      store(h.v + k, select(hit, load(rays.hit.v), load(h.v + k)));
      store(h.n[0] + k, select(hit, load(rays.hit.Ng_x), load(h.n[0] + k)));
      store(h.n[1] + k, select(hit, load(rays.hit.Ng_y), load(h.n[1] + k)));
      store(h.n[2] + k, select(hit, load(rays.hit.Ng_z), load(h.n[2] + k)));
    }
  }
  return changed;
}

// Side walls and base of a height field, seen from outside. Few rays hit them, so they are
// processed one lane at a time.
inline bool trace_walls_of_packet(const Tracing& at, const Pixels& pixels, Hits& hits) {
  const ViewGeom& g = at.geom;
  const rays::HeightField& f = *g.height_field;
  const float center[3] = {0, 0, 0.5f * (f.lid - f.size[3])};
  const float half[3] = {f.size[0], f.size[1], 0.5f * (f.lid + f.size[3])};
  bool changed = false;
  for (int k = 0; k < kLanes; k += kWidth) {
    const LocalRay ray = at.ray(pixels, k);
    const Interval inside = box(ray.o, ray.d, center, half);
    const Mask hit = (inside.enter < load(hits.t + k)) & (load(pixels.near + k) < inside.enter) &
                     (inside.enter <= inside.exit);
    const std::uint32_t lanes = bits(hit);
    if (!lanes) continue;
    alignas(64) float t[kWidth], p[3][kWidth];
    const Vec3f point = along(ray.o, inside.enter, ray.d);
    store(t, inside.enter);
    store(p[0], point.x);
    store(p[1], point.y);
    store(p[2], point.z);
    for (int i = 0; i < kWidth; ++i) {
      if (!(lanes >> i & 1u)) continue;
      const float x = p[0][i] / f.size[0], y = p[1][i] / f.size[1];
      const float z = (p[2][i] - center[2]) / half[2];
      const float ax = x < 0 ? -x : x, ay = y < 0 ? -y : y, az = z < 0 ? -z : z;
      const bool vertical = az > ax && az > ay;
      if (vertical && z > 0) continue;  // entered through the open top
      const float column = 0.5f * (x + 1) * (f.cols - 1), row = 0.5f * (y + 1) * (f.rows - 1);
      if (!vertical && p[2][i] > border_height(f, column, row)) continue;
      changed = true;
      hits.t[k + i] = t[i];
      hits.id[k + i] = g.id;
      hits.geom[k + i] = at.index;
      hits.prim[k + i] = -1;
      hits.n[0][k + i] = vertical ? 0.0f : ax >= ay ? x : 0.0f;
      hits.n[1][k + i] = vertical || ax >= ay ? 0.0f : y;
      hits.n[2][k + i] = vertical ? -1.0f : 0.0f;
    }
  }
  return changed;
}

inline PacketMask trace_walls(const Tracing& at, const Pixels* pixels, Hits* hits,
                              PacketMask packets) {
  const ViewGeom& g = at.geom;
  const float *size = g.height_field->size, *eye = g.eye;
  const bool above = -size[0] < eye[0] && eye[0] < size[0] && -size[1] < eye[1] &&
                     eye[1] < size[1] && -size[3] < eye[2];
  // From inside the field's sides and above its base, the camera sees no wall from outside.
  if (above && !at.orthographic) return 0;
  PacketMask changed = 0;
  for (; packets; packets &= packets - 1) {
    const int q = __builtin_ctz(packets);
    changed |= static_cast<PacketMask>(trace_walls_of_packet(at, pixels[q], hits[q])) << q;
  }
  return changed;
}

// Traces a solid or a plane; enter(o, d) returns the distance of the hit.
template <typename Enter>
PacketMask trace_surface(const Tracing& at, const Pixels* pixels, Hits* hits, PacketMask packets,
                         Enter enter) {
  const Int id = int_of(at.geom.id), index = int_of(at.index);
  PacketMask changed = 0;
  for (; packets; packets &= packets - 1) {
    const int q = __builtin_ctz(packets);
    Hits& h = hits[q];
    for (int k = 0; k < kLanes; k += kWidth) {
      const LocalRay ray = at.ray(pixels[q], k);
      const Float t = enter(ray.o, ray.d), before = load(h.t + k);
      const Int id_before = load(h.id + k);
      const Mask hit = shows(t, id, before, id_before) & (load(pixels[q].near + k) < t);
      changed |= static_cast<PacketMask>(any(hit)) << q;
      store(h.id + k, select(hit, id, id_before));
      store(h.t + k, select(hit, t, before));
      store(h.geom + k, select(hit, index, load(h.geom + k)));
    }
  }
  return changed;
}

// Traces geom `index`, front faces only, and stores hits that are nearer than those in `hits`.
// Returns the packets that changed.
inline PacketMask trace_geom(const View& view, int index, const Pixels* pixels, Hits* hits,
                             PacketMask packets) {
  static constexpr float kOrigin[3] = {0, 0, 0};
  const Tracing at(view, index);
  const ViewGeom& g = at.geom;
  const auto surface = [&](auto enter) { return trace_surface(at, pixels, hits, packets, enter); };
  switch (g.type) {
    case mjGEOM_PLANE:
      return surface([&](Vec3f o, Vec3f d) { return plane(g, o, d, g.shows_back); });
    case mjGEOM_SPHERE:
      return surface([&](Vec3f o, Vec3f d) { return sphere(o, d, g.size[0]).enter; });
    case mjGEOM_CAPSULE:
      return surface([&](Vec3f o, Vec3f d) { return capsule(o, d, g.size[0], g.size[1]).enter; });
    case mjGEOM_ELLIPSOID:
      return surface([&](Vec3f o, Vec3f d) { return ellipsoid(o, d, g.size).enter; });
    case mjGEOM_CYLINDER:
      return surface([&](Vec3f o, Vec3f d) { return cylinder(o, d, g.size[0], g.size[1]).enter; });
    case mjGEOM_BOX:
      return surface([&](Vec3f o, Vec3f d) { return box(o, d, kOrigin, g.size).enter; });
    default:
      break;
  }
  PacketMask changed = has_triangles(g) ? trace_triangles(at, pixels, hits, packets) : 0;
  if (g.height_field) changed |= trace_walls(at, pixels, hits, packets);
  return changed;
}

inline void clear(Hits& hits, float far) {
  for (int k = 0; k < kLanes; k += kWidth) {
    store(hits.t + k, splat(far));
    store(hits.id + k, int_of(-1));
    store(hits.geom + k, int_of(-1));
  }
}

}  // namespace
}  // namespace mjsense::render
