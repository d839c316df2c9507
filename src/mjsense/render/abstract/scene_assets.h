// SPDX-License-Identifier: Apache-2.0
#pragma once
// Meshes, convex hulls, height fields and textures of a model, each prepared when it is first drawn.

#include <mujoco/mujoco.h>

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "mjsense/rays/shared_geometry.h"
#include "mjsense/render/view/surface_assets.h"

namespace mjsense::render {

// A mesh and its faces' tables.
struct DrawnMesh {
  std::shared_ptr<const rays::MeshGeometry> geometry;
  std::shared_ptr<const MeshTables> tables;
  MeshSurface surface;
  int uses = 0;
  // With a better tree, for shadow rays, whose results do not depend on the tree; null before many
  // uses.
  std::shared_ptr<const rays::MeshGeometry> shadows;
};

class SceneAssets {
 public:
  // `model` (model_of_arrays()) must outlive this object.
  explicit SceneAssets(const mjModel* model);

  // Null if the mesh or hull has no faces. id as in mjvGeom::dataid: 2 * mesh, or 2 * mesh + 1 for
  // its convex hull.
  const DrawnMesh* mesh(int id);
  // Null for -1 and for a texture that cannot be drawn.
  const Texture* texture(int id);
  const Texture* skybox();  // null if the model has none
  const rays::HeightField& height_field(int id);
  const rays::SharedGeometry& height_fields() const { return *height_fields_; }
  // Texture coordinates of the skin's faces; null if it has none.
  const MeshSurface& skin(int id);

  // Makes the next image show the current contents of the model's arrays.
  void reload();
  // Reloads the textures, height fields and meshes whose arrays have changed at one of the places
  // that are compared: every value of a small array, and kPlaces spread over a large one.
  static constexpr int kPlaces = 128;
  void reload_changed();

 private:
  struct Stamp {
    std::uint64_t value = 0;
    // Whether the contents differ from those of the last call.
    bool changed(const void* data, std::size_t bytes);
  };
  DrawnMesh hull(int mesh) const;
  std::shared_ptr<const rays::MeshGeometry> geometry(int mesh, bool clusters,
                                                     rays::BuildQuality quality) const;

  // Number of images after which a better tree is built.
  static constexpr int kManyUses = 50;

  const mjModel* model_;
  bool improved_ = false;  // whether a mesh got its better tree in this image
  std::vector<std::unique_ptr<DrawnMesh>> meshes_;  // [2 * nmesh]
  std::vector<std::shared_ptr<const StoredTexture>> textures_;
  std::vector<Stamp> mesh_stamps_, texture_stamps_, height_field_stamps_;
  std::unique_ptr<rays::SharedGeometry> height_fields_;
  std::unique_ptr<SurfaceAssets> skins_;
};

}  // namespace mjsense::render
