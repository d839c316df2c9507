// SPDX-License-Identifier: Apache-2.0
#pragma once
// Meshes of objects at every size that they can have. Geoms of other types are scaled by their
// size, but a mesh must be compiled once for each size.

#include <span>
#include <string>
#include <vector>

#include "mjsense/scene/scene.h"

namespace mjsense::tasks::scenes {

// Meshes of `objects` in the scene `things`, which has no robot.
class ObjectMeshes {
 public:
  struct Object {
    std::string body;  // full name
    std::vector<double> sizes;
  };
  ObjectMeshes() = default;
  // Throws KeyError for an unknown body.
  ObjectMeshes(scene::SceneCfg things, std::span<const Object> objects);

  // Adds the meshes to the complete scene's spec.
  void add(mjSpec* spec) const;
  // Id of mesh `mesh` at size `step` in the complete scene's model; -1 if there is none.
  static int find(const mjModel* model, int mesh, int step);

 private:
  struct Mesh {
    std::string name;
    std::vector<double> sizes;
    std::vector<float> vertices, normals, texcoords;
    std::vector<int> faces, face_normals, face_texcoords;
  };
  std::vector<Mesh> meshes_;
};

}  // namespace mjsense::tasks::scenes
