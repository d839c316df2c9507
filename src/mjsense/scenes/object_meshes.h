// SPDX-License-Identifier: Apache-2.0
#pragma once
// Meshes of objects in every size that they may have. A geom's size scales what it is, but for a mesh: that is
// compiled once more for each size.

#include <span>
#include <string>
#include <vector>

#include "mjsense/scene/scene.h"

namespace mjsense {

// Of `objects` in the scene made of `things`, which has no robot.
class ObjectMeshes {
 public:
  struct Object {
    std::string body;  // full name
    std::vector<double> sizes;
  };
  ObjectMeshes() = default;
  // Throws KeyError for a body that there is not.
  ObjectMeshes(SceneCfg things, std::span<const Object> objects);

  // Adds them to the whole scene's spec.
  void add(mjSpec* spec) const;
  // Of the mesh `mesh` in size `step`, in the whole scene's model; -1 if there is none.
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

}  // namespace mjsense
