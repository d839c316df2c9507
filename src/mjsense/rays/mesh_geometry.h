// SPDX-License-Identifier: Apache-2.0
#pragma once
// Triangle meshes in the forms that rays and cameras use: a BVH, clusters and horizons. Everything in
// the process that has an equal mesh shares them.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "mjsense/core/content_cache.h"
#include "mjsense/rays/embree.h"
#include "mjsense/rays/horizons.h"
#include "mjsense/rays/triangle_clusters.h"

namespace mjsense::rays {

struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using SceneHandle = std::unique_ptr<RTCSceneTy, SceneRelease>;

// Embree's device, shared by the whole process and released with the last handle. The environment
// variable MJSENSE_EMBREE adds to its settings (e.g. max_isa=avx2). Throws RuntimeError.
std::shared_ptr<RTCDeviceTy> ray_device();

// Throws RuntimeError if Embree reported an error in this thread since the last check. Embree only
// records errors; without this check rays would hit nothing. `what` names the object that was
// built.
void check_built(RTCDevice device, const std::string& what);

// How a mesh is built. Occlusion does not depend on it; of several hits at the same distance another
// may be found.
enum class BuildQuality : std::uint8_t {
  kHigh,  // for many rays in all directions
  kFast,  // a quarter of the time; later images take up to 1.07 times as long
};

// Builds a scene of one triangle mesh; positions [n, 3] and indices [m, 3] are copied. Throws
// RuntimeError.
SceneHandle build_triangles(RTCDevice device, std::span<const float> vertices,
                            std::span<const int> faces, BuildQuality quality);

// A mesh's arrays, vertices [n, 3] (m) and faces [m, 3], with their key in the process-wide caches.
struct MeshArrays {
  MeshArrays(std::span<const float> mesh_vertices, std::span<const int> mesh_faces)
      : vertices(mesh_vertices),
        faces(mesh_faces),
        key(ContentKey().add(mesh_vertices).add(mesh_faces)) {}

  std::span<const float> vertices;
  std::span<const int> faces;
  ContentKey key;
};

struct MeshScene {
  std::shared_ptr<RTCDeviceTy> device;
  SceneHandle scene;
};

// Centre and half sizes of the bounding box of points [n, 3].
void box_around(std::span<const float> points, float box[6]);

// The parts of a mesh with faces. Each is built if nothing in the process has it.
std::shared_ptr<const MeshScene> mesh_scene(const MeshArrays& mesh, BuildQuality quality);
std::shared_ptr<const Clusters> mesh_clusters(const MeshArrays& mesh);
std::shared_ptr<const Horizons> mesh_horizons(const MeshArrays& mesh);

// All parts of a mesh. Without faces there are none.
struct MeshGeometry {
  // `images`: also what only cameras need.
  MeshGeometry(const MeshArrays& mesh, bool images);

  std::shared_ptr<const MeshScene> scene;
  std::shared_ptr<const Clusters> clusters;  // null unless requested
  std::shared_ptr<const Horizons> horizons;  // null unless requested
  std::array<float, 6> box;                  // bounding box of all vertices: centre, half sizes, m
};

}  // namespace mjsense::rays
