// SPDX-License-Identifier: Apache-2.0
#pragma once
// The flexes and skins of an abstract scene.

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "mjsense/rays/deformable_mesh.h"
#include "mjsense/rays/mesh_geometry.h"
#include "mjsense/render/abstract/abstract_scene.h"
#include "mjsense/render/abstract/scene_assets.h"
#include "mjsense/render/abstract/scene_memory.h"
#include "mjsense/render/view/drawn_scene.h"

namespace mjsense::render {

// Keeps their triangles from image to image.
class SoftGeoms {
 public:
  // `model` and `assets` must outlive this object.
  SoftGeoms(const mjModel* model, SceneAssets& assets, const SoftArrays& arrays)
      : model_(model), assets_(assets), arrays_(arrays), device_(rays::ray_device()) {}

  // Appends what shows the geom to `out`. `like`: its material.
  void add_flex(const AbstractGeom& geom, const DrawnGeom& like, const SceneMemory& scene,
                std::vector<DrawnGeom>& out);
  void add_skin(const AbstractGeom& geom, const DrawnGeom& like, std::vector<DrawnGeom>& out);

 private:
  // Triangles that move.
  struct Soft {
    rays::DeformableMesh mesh;
    std::vector<float> normals;
    std::vector<int> faces;  // of a flex: its corners in order
    MeshSurface surface;
    int num_faces = 0;
    float box[6];
  };
  void add_flex_frame(int id, float radius, const DrawnGeom& like, const SceneMemory& scene,
                      std::vector<DrawnGeom>& out) const;
  void add_flex_faces(int id, int first, int count, bool has_uvs, const DrawnGeom& like,
                      std::vector<DrawnGeom>& out);

  const mjModel* model_;
  SceneAssets& assets_;
  SoftArrays arrays_;
  std::shared_ptr<RTCDeviceTy> device_;
  std::map<int, std::unique_ptr<Soft>> skins_;
  std::map<std::pair<int, int>, std::unique_ptr<Soft>> flexes_;  // by flex and first face
};

}  // namespace mjsense::render
