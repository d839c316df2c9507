// SPDX-License-Identifier: Apache-2.0
#pragma once
// Packets of 16 rays and hits, in the layout of the kernels: one array per component, no
// allocation.

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace mjsense::rays {

inline constexpr int kPacket = 16;
inline constexpr float kNoHit = std::numeric_limits<float>::infinity();

// 16 rays p(t) = origin + o + t d, t in [0, tmax]. `origin` is in double and should be near the
// rays' origins (e.g. the sensor's position), so that precision does not depend on the position in
// the world. Directions must have length 1. A lane with tmax < 0 is inactive.
struct alignas(64) RayPacket {
  float o[3][kPacket];  // m, relative to `origin`, world axes
  float d[3][kPacket];
  float tmax[kPacket];  // m
  double origin[3];     // m, world frame
};

// The same rays in the sensor's frame, before the sensor's pose is applied. active < 0: the lane is
// inactive.
struct alignas(64) LocalPacket {
  float o[3][kPacket];
  float d[3][kPacket];
  float active[kPacket];
};

// First hits of the rays. A ray without a hit has t = kNoHit, geom = -1, and 0 in all other fields.
struct alignas(64) HitPacket {
  float t[kPacket];   // m
  int geom[kPacket];  // geom id; num_geoms + flex id for a flex
  // Mesh: face id. Height field: 2 * cell + triangle, or -1 for base and side walls. Flex: triangle
  // id.
  int prim[kPacket];
  float n[3][kPacket];  // unit normal, world frame: outward, or by the triangle's winding
  // Mesh and flex: barycentric weights of the triangle's second and third vertex.
  float u[kPacket], v[kPacket];
};

// Hits in the layout of sensor outputs, ray by ray: x, y, z of the first ray, then of the second...
struct alignas(64) RayOutputs {
  float distance[kPacket];  // m; -1: no hit
  float pos[3 * kPacket];   // m, world frame; the ray's start if there is no hit
  float normal[3 * kPacket];
  int body[kPacket], material[kPacket];  // -1: none; written only if requested
};

// Lidar returns, for a receiver at the ray's origin.
struct alignas(64) LidarReturns {
  float point[3 * kPacket];  // m, sensor frame; 0: no return
  float intensity[kPacket];  // mean of the surface's RGB times the cosine of incidence, 0..1
};

// A geom that a packet may hit, at distance t or farther.
struct RayCandidate {
  float t;  // m
  int geom;
};

struct Hit {
  double t = kNoHit;  // m
  int geom = -1;
  int prim = 0;
  std::array<float, 3> normal{};
  float u = 0, v = 0;
  bool operator!() const { return geom < 0; }
};

// Which geoms a query can hit. The filter belongs to the query, so one sensor's settings do not
// affect another sensor.
struct RayFilter {
  enum class Backfaces {
    kHit,       // as mj_ray: meshes from both sides, solids also from inside
    kCullMesh,  // triangles only from their front side (by winding)
    kCull,      // as MuJoCo's renderer: kCullMesh, and solids only from outside
  };
  std::uint32_t groups = 0x3f;  // bit g: geoms of group g, clamped to 0..5 as in MuJoCo
  int exclude_body = -1;        // the body's own geoms are skipped, those of its children are not
  bool transparent = false;     // also hit geoms of alpha 0
  Backfaces backfaces = Backfaces::kHit;
  // Per geom and flex; nonzero: skipped. Empty: none is skipped.
  std::span<const std::uint8_t> hidden;
};

}  // namespace mjsense::rays
