// SPDX-License-Identifier: Apache-2.0
#pragma once
// Rays and hits in groups of 16, as the kernels take them: arrays by component, no allocation.

#include <array>
#include <cstdint>
#include <limits>
#include <span>

namespace mjsense {

inline constexpr int kPacket = 16;
inline constexpr float kNoHit = std::numeric_limits<float>::infinity();

// 16 rays p(t) = origin + o + t d, t in [0, tmax]. Give `origin` in double and near the rays'
// origins (a sensor's frame): what is close to it is precise, wherever in the world it is.
// Directions must have length 1. A lane with tmax < 0 is no ray.
struct alignas(64) RayPacket {
  float o[3][kPacket];  // m, relative to `origin`, world axes
  float d[3][kPacket];
  float tmax[kPacket];  // m
  double origin[3];     // m, world
};

// The same rays in a sensor's frame, before the sensor's pose is known; active < 0: no ray.
struct alignas(64) LocalPacket {
  float o[3][kPacket];
  float d[3][kPacket];
  float active[kPacket];
};

// What the rays hit first. A ray without a hit has t = kNoHit, geom = -1, and everything else 0.
struct alignas(64) HitPacket {
  float t[kPacket];   // m
  int geom[kPacket];  // geom id; num_geoms + flex id for a flex
  // Mesh: its face. Height field: 2 * cell + triangle, -1 for base and sides. Flex: its triangle.
  int prim[kPacket];
  float n[3][kPacket];  // unit normal in the world: outward, or by the triangle's winding
  // Mesh and flex: barycentric weights of the triangle's second and third vertex.
  float u[kPacket], v[kPacket];
};

// The same as sensors report it, ray by ray: x, y, z of the first, then of the second...
struct alignas(64) HitRows {
  float distance[kPacket];  // m; -1: no hit
  float pos[3 * kPacket];   // m, world; without a hit the ray's start
  float normal[3 * kPacket];
  int body[kPacket], material[kPacket];  // -1: none; if asked for
};

// And as a receiver beside the sender would.
struct alignas(64) ReturnRows {
  float point[3 * kPacket];  // m, sensor frame; 0: no return
  float intensity[kPacket];  // mean of the surface's colour times the cosine of incidence, 0..1
};

// A geom that a packet may meet, not before t.
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

// Which geoms a query sees. It belongs to the query: no sensor's choice changes what another one
// sees.
struct RayFilter {
  enum class Backfaces {
    kHit,       // as mj_ray: meshes from both sides, solids also from inside
    kCullMesh,  // triangles only from the side they are wound towards
    kCull,      // as MuJoCo's renderer: and solids only from outside
  };
  std::uint32_t groups = 0x3f;  // bit g: geoms of group g, clamped to 0..5 as MuJoCo does
  int exclude_body = -1;        // geoms of this body are not seen; its children's are
  bool transparent = false;     // see geoms of alpha 0 too
  Backfaces backfaces = Backfaces::kHit;
  // Per geom and flex, nonzero: not seen. Empty: all are.
  std::span<const std::uint8_t> hidden;
};

}  // namespace mjsense
