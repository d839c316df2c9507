// SPDX-License-Identifier: Apache-2.0
#pragma once
// Implementation of the ray kernels: packets of 16 rays against candidate geoms, kWidth lanes at a
// time. Included by one .cc file per instruction set.
//
// Precision in float32: a packet's origin is transformed into a geom's frame in double. Solids are
// solved from the ray's point nearest to their centre, meshes from the point where the ray enters
// their bounding box. Thus the numbers are small where precision matters.

#include <mujoco/mujoco.h>

#include "mjsense/core/simd.h"
#include "mjsense/rays/analytic_shapes.h"
#include "mjsense/rays/embree.h"
#include "mjsense/rays/height_field.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/packet_culling.h"
#include "mjsense/rays/ray_geom.h"
#include "mjsense/rays/ray_outputs.h"

namespace mjsense::rays {
namespace {

// A geom's frame for one packet: p_G = base + R^T o, d_G = R^T d.
struct Frame {
  float base[3];
  const float* r;

  Frame(const RayGeom& g, const double* origin) : r(g.rot) {
    const double x = origin[0] - g.pos[0], y = origin[1] - g.pos[1], z = origin[2] - g.pos[2];
    for (int i = 0; i < 3; ++i)
      base[i] = static_cast<float>(g.mat[i] * x + g.mat[3 + i] * y + g.mat[6 + i] * z);
  }
  Vec3f direction(const float (*d)[kPacket], int k) const {
    const Float x = load(d[0] + k), y = load(d[1] + k), z = load(d[2] + k);
    return {fma(r[0], x, fma(r[3], y, Float(r[6]) * z)),
            fma(r[1], x, fma(r[4], y, Float(r[7]) * z)),
            fma(r[2], x, fma(r[5], y, Float(r[8]) * z))};
  }
  Vec3f point(const float (*o)[kPacket], int k) const {
    const Vec3f p = direction(o, k);
    return {p.x + base[0], p.y + base[1], p.z + base[2]};
  }
  Vec3f to_world(Vec3f n) const {
    return {fma(r[0], n.x, fma(r[1], n.y, Float(r[2]) * n.z)),
            fma(r[3], n.x, fma(r[4], n.y, Float(r[5]) * n.z)),
            fma(r[6], n.x, fma(r[7], n.y, Float(r[8]) * n.z))};
  }
};

Vec3f unit(Vec3f n) {
  const Float s = Float(1.0f) / sqrt(max(dot(n, n), 1e-30f));
  return {n.x * s, n.y * s, n.z * s};
}

// Lanes whose hit at t is nearer than the best hit so far, or equally near (within rounding) and of
// a lower geom id.
Mask nearer(const HitPacket& hits, const RayPacket& rays, int k, Float t, int geom) {
  const Float best = load(hits.t + k);
  const Float tolerance = fma(t, 4e-7f, 1e-7f);
  const Mask before = t < best - tolerance;
  const Mask tie = (t <= best + tolerance) & less(int_of(geom), load(hits.geom + k));
  return (before | tie) & (t <= load(rays.tmax + k)) & (t < Float(kNoHit));
}

void put(HitPacket& hits, int k, Mask m, Float t, int geom, Int prim, Vec3f n) {
  store(hits.t + k, select(m, t, load(hits.t + k)));
  store(hits.geom + k, select(m, int_of(geom), load(hits.geom + k)));
  store(hits.prim + k, select(m, prim, load(hits.prim + k)));
  store(hits.n[0] + k, select(m, n.x, load(hits.n[0] + k)));
  store(hits.n[1] + k, select(m, n.y, load(hits.n[1] + k)));
  store(hits.n[2] + k, select(m, n.z, load(hits.n[2] + k)));
  store(hits.u + k, select(m, Float(0.0f), load(hits.u + k)));
  store(hits.v + k, select(m, Float(0.0f), load(hits.v + k)));
}

template <class Shape>
void trace_solid(const RayGeom& g, int id, bool cull, const RayPacket& rays, HitPacket& hits) {
  const Frame frame(g, rays.origin);
  for (int k = 0; k < kPacket; k += kWidth) {
    const Vec3f o = frame.point(rays.o, k), d = frame.direction(rays.d, k);
    const Float t = Shape::intersect(g.size, o, d, cull);
    const Mask m = nearer(hits, rays, k, t, id);
    if (any(m))
      put(hits, k, m, t, id, int_of(0), frame.to_world(Shape::normal(g.size, along(o, t, d))));
  }
}

// kWidth rays in a mesh's frame. Each starts shortly before it enters the mesh's bounding box;
// `start` is the distance of that point along the original ray.
struct MeshRays {
  EmbreeRayHits rh;
  alignas(64) int valid[kWidth];
  Float start;

  // Loads rays k .. k + kWidth - 1 of the packet, except those that reach the box beyond `limit`.
  // Returns whether any ray is left.
  bool prepare(const RayGeom& g, const Frame& frame, const RayPacket& rays, int k, Float limit) {
    const float pad = 1e-5f + 1e-4f * (g.half[0] + g.half[1] + g.half[2]);
    const Vec3f o = frame.point(rays.o, k), d = frame.direction(rays.d, k);
    const float size[3] = {g.half[0] + pad, g.half[1] + pad, g.half[2] + pad};
    const Vec3f c = {o.x - g.center[0], o.y - g.center[1], o.z - g.center[2]};
    const Interval in = Box::interval(size, c, d);
    const Float t = max(in.enter, 0.0f);
    const Mask m = (in.enter <= in.leave) & (in.leave >= Float(0.0f)) & (t <= limit);
    if (!any(m)) return false;
    const Vec3f p = along(o, t, d);
    start = t;
    store(valid, select(m, int_of(-1), int_of(0)));
    store(rh.ray.org_x, p.x);
    store(rh.ray.org_y, p.y);
    store(rh.ray.org_z, p.z);
    store(rh.ray.dir_x, d.x);
    store(rh.ray.dir_y, d.y);
    store(rh.ray.dir_z, d.z);
    store(rh.ray.tnear, Float(0.0f));
    store(rh.ray.tfar, fma(limit, 1.000001f, 1e-6f) - t);
    store(rh.ray.time, Float(0.0f));
    store(reinterpret_cast<int*>(rh.ray.mask), int_of(-1));
    store(reinterpret_cast<int*>(rh.ray.id), int_of(0));
    store(reinterpret_cast<int*>(rh.ray.flags), int_of(0));
    store(reinterpret_cast<int*>(rh.hit.geomID), int_of(-1));
    store(reinterpret_cast<int*>(rh.hit.instID[0]), int_of(-1));
    return true;
  }
};

void trace_triangles(RTCScene scene, const RayGeom& g, int id, bool cull, const RayPacket& rays,
                     HitPacket& hits) {
  const Frame frame(g, rays.origin);
  MeshRays mesh;
  for (int k = 0; k < kPacket; k += kWidth) {
    const Float limit = min(load(hits.t + k), load(rays.tmax + k));
    if (!mesh.prepare(g, frame, rays, k, limit)) continue;
    embree_intersect(mesh.valid, scene, &mesh.rh, cull, false);
    const Mask found = less(load(mesh.valid), int_of(0)) &
                       ~less(load(reinterpret_cast<int*>(mesh.rh.hit.geomID)), int_of(0));
    if (!any(found)) continue;
    const Float t = select(found, mesh.start + load(mesh.rh.ray.tfar), Float(kNoHit));
    const Mask m = nearer(hits, rays, k, t, id);
    if (!any(m)) continue;
    const Vec3f n = unit({load(mesh.rh.hit.Ng_x), load(mesh.rh.hit.Ng_y), load(mesh.rh.hit.Ng_z)});
    put(hits, k, m, t, id, load(reinterpret_cast<int*>(mesh.rh.hit.primID)), frame.to_world(n));
    store(hits.u + k, select(m, load(mesh.rh.hit.u), load(hits.u + k)));
    store(hits.v + k, select(m, load(mesh.rh.hit.v), load(hits.v + k)));
  }
}

void trace_height_field(const HeightField& field, const RayGeom& g, int id, bool cull,
                        const RayPacket& rays, HitPacket& hits) {
  const Frame frame(g, rays.origin);
  for (int k = 0; k < kPacket; k += kWidth) {
    const Vec3f o = frame.point(rays.o, k), d = frame.direction(rays.d, k);
    const Float limit = min(tied(load(hits.t + k)), load(rays.tmax + k));
    const FieldHit hit = intersect_height_field(field, o, d, limit, cull);
    const Mask m = nearer(hits, rays, k, hit.t, id);
    if (any(m)) put(hits, k, m, hit.t, id, hit.prim, frame.to_world(hit.normal));
  }
}

// The BVH of a mesh, SDF or flex; null if it has no triangles.
RTCScene triangles_of(const KernelScene& scene, const KernelWorld& world, const RayGeom& g) {
  if (g.type == kFlexType) return static_cast<RTCScene>(world.flex_scenes[g.data]);
  return static_cast<RTCScene>(scene.mesh_scenes[g.data]);
}

void trace(const KernelScene& scene, const KernelWorld& world, const KernelFilter& filter,
           const RayPacket& rays, HitPacket& hits, const RayCandidate* candidates, int count) {
  for (int k = 0; k < kPacket; k += kWidth) {
    store(hits.t + k, Float(kNoHit));
    store(hits.geom + k, int_of(-1));
    store(hits.prim + k, int_of(0));
    for (float* p : {hits.n[0], hits.n[1], hits.n[2], hits.u, hits.v}) store(p + k, Float(0.0f));
  }
  const bool cull = filter.cull_solid, cull_mesh = filter.cull_mesh;
  for (int c = 0; c < count; ++c) {
    bool reachable = false;  // candidates are sorted by distance
    for (int k = 0; k < kPacket; k += kWidth)
      reachable |= any(Float(candidates[c].t) <= min(load(hits.t + k), load(rays.tmax + k)));
    if (!reachable) break;
    const int id = candidates[c].geom;
    const RayGeom& g = world.geoms[id];
    switch (g.type) {
      case mjGEOM_PLANE:
        trace_solid<Plane>(g, id, cull, rays, hits);
        break;
      case mjGEOM_SPHERE:
        trace_solid<Sphere>(g, id, cull, rays, hits);
        break;
      case mjGEOM_CAPSULE:
        trace_solid<Capsule>(g, id, cull, rays, hits);
        break;
      case mjGEOM_ELLIPSOID:
        trace_solid<Ellipsoid>(g, id, cull, rays, hits);
        break;
      case mjGEOM_CYLINDER:
        trace_solid<Cylinder>(g, id, cull, rays, hits);
        break;
      case mjGEOM_BOX:
        trace_solid<Box>(g, id, cull, rays, hits);
        break;
      case mjGEOM_HFIELD:
        trace_height_field(scene.height_fields[g.data], g, id, cull, rays, hits);
        break;
      case mjGEOM_MESH:
      case mjGEOM_SDF:
      case kFlexType:
        if (const RTCScene triangles = triangles_of(scene, world, g))
          trace_triangles(triangles, g, id, cull_mesh, rays, hits);
        break;
      default:
        break;
    }
  }
}

void to_world(const LocalPacket& local, const float* r, float tmax, RayPacket& out) {
  for (int k = 0; k < kPacket; k += kWidth) {
    const Vec3f o = {load(local.o[0] + k), load(local.o[1] + k), load(local.o[2] + k)};
    const Vec3f d = {load(local.d[0] + k), load(local.d[1] + k), load(local.d[2] + k)};
    for (int i = 0; i < 3; ++i) {
      const Vec3f row = {r[3 * i], r[3 * i + 1], r[3 * i + 2]};
      store(out.o[i] + k, dot(row, o));
      store(out.d[i] + k, dot(row, d));
    }
    store(out.tmax + k, load(local.active + k) * tmax);
  }
}

constexpr RayKernels kKernels = {&to_world, &cull, &gather, &gather_from, &trace, &rows, &returns};

}  // namespace
}  // namespace mjsense::rays
