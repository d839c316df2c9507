// SPDX-License-Identifier: Apache-2.0
#pragma once
// Meshes, convex hulls, height fields and textures of a model, each prepared when it is first drawn.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "mjsense/rays/shared_geometry.h"
#include "mjsense/render/abstract/drawn_mesh.h"
#include "mjsense/render/view/surface_assets.h"

namespace mjsense::render {

// A texture of a model. Its levels are stored when an image first needs them.
class DrawnTexture final : public TextureOnDemand {
 public:
  DrawnTexture(const mjModel* model, int id);
  DrawnTexture(const DrawnTexture&) = delete;
  DrawnTexture& operator=(const DrawnTexture&) = delete;

  const Texture& texture() const { return texture_; }
  void add_level(int level) override;

 private:
  const mjModel* model_;
  int id_;
  Texture texture_;
  std::shared_ptr<const StoredTexture> stored_;
};

// Number of meshes and textures whose parts have been built.
struct PreparedAssets {
  int meshes = 0;  // that an image needed at all
  int clusters = 0, trees = 0, surfaces = 0;
  int textures = 0;
  int levels = 0;  // of all textures
};

class SceneAssets {
 public:
  // `model` (model_of_arrays()) must outlive this object.
  explicit SceneAssets(const mjModel* model);

  // Null if the mesh or hull has no faces. id as in mjvGeom::dataid.
  DrawnMesh* mesh(int id);
  // Null for -1 and for a texture that cannot be drawn.
  const Texture* texture(int id);
  const Texture* skybox();  // null if the model has none
  const rays::HeightField& height_field(int id);
  const rays::SharedGeometry& height_fields() const { return *height_fields_; }
  // Texture coordinates of the skin's faces; null if it has none.
  const MeshSurface& skin(int id);

  // Makes the next image show the current contents of the model's arrays.
  void reload();
  // Call before each image. Reloads the textures, height fields and meshes whose arrays have changed
  // at one of the places that are compared: every value of a small array, and kPlaces spread over a
  // large one. Returns whether there are any.
  static constexpr int kPlaces = 128;
  bool begin_image();

  PreparedAssets prepared() const;

 private:
  struct Stamp {
    std::uint64_t value = 0;
    // Whether the contents differ from those of the last call.
    bool changed(const void* data, std::size_t bytes);
  };
  const mjModel* model_;
  bool improved_ = false;  // whether a mesh got its better tree in this image
  std::vector<std::unique_ptr<DrawnMesh>> meshes_;  // [2 * nmesh]
  std::vector<std::unique_ptr<DrawnTexture>> textures_;
  std::vector<Stamp> mesh_stamps_, texture_stamps_, height_field_stamps_;
  Stamp height_field_sizes_;
  std::unique_ptr<rays::SharedGeometry> height_fields_;
  std::unique_ptr<SurfaceAssets> skins_;
};

}  // namespace mjsense::render
