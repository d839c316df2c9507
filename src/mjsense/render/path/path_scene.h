// SPDX-License-Identifier: Apache-2.0
#pragma once
// The geoms of a view as the ray kernels need them, for rays from anywhere. Frame: the camera's.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/rays/kernels.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/light/microfacets.h"
#include "mjsense/render/view/view.h"

namespace mjsense::rays {
class BoxList;
}  // namespace mjsense::rays

namespace mjsense::render {

inline Vec3 vec3(const float* p) { return {p[0], p[1], p[2]}; }

struct PathRay {
  float o[3], d[3];  // m; unit
  float tmax;        // m
};

struct PathHit {
  float t;     // m; infinity: no hit
  int geom;    // index in View::geoms, or -1
  int prim;    // as rays::HitPacket's
  float n[3];  // unit, outward or by the triangle's winding
  float u, v;
};

class PathScene {
 public:
  PathScene();
  ~PathScene();
  PathScene(PathScene&&) noexcept;

  // `view` has PhysicalView::all_geoms, and stays valid while the scene is used.
  void build(const View& view);
  const View& view() const { return *view_; }

  // What stops rays. A camera sees triangles from their front only, and geoms without shadows.
  // Light is stopped by the geoms that cast shadows; by triangles from both sides.
  enum class Stops { kSight, kLight };
  // Finds the nearest hits of any number of rays; those with equal distance show the geom that the
  // kernels of images show. The results depend on the arguments only.
  void trace(std::span<const PathRay> rays, Stops stops, std::span<PathHit> hits) const;

 private:
  const View* view_ = nullptr;
  const rays::RayKernels* kernels_;
  std::vector<rays::RayGeom> geoms_;  // by descending ViewGeom::id, because rays prefer low indices
  std::vector<int> index_;            // in View::geoms
  std::unique_ptr<rays::BoxList> boxes_;
  std::vector<std::uint32_t> flags_;
  std::vector<int> bodies_;
  std::vector<void*> triangles_;  // RTCScene
  std::vector<rays::HeightField> height_fields_;
};

}  // namespace mjsense::render
