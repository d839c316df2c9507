// SPDX-License-Identifier: Apache-2.0
#pragma once
// A mesh of a model, or its convex hull, whose parts are built when an image first needs them.

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <optional>
#include <span>

#include "mjsense/rays/mesh_geometry.h"
#include "mjsense/render/view/surface_assets.h"
#include "mjsense/render/view/view_geom.h"

namespace mjsense::render {

class DrawnMesh final : public MeshOnDemand {
 public:
  // id as in mjvGeom::dataid: 2 * mesh, or 2 * mesh + 1 for its convex hull. `model`
  // (model_of_arrays()) must outlive this object. `improved`: whether some mesh got a better tree in
  // this image.
  DrawnMesh(const mjModel* model, int id, bool& improved);
  DrawnMesh(const DrawnMesh&) = delete;
  DrawnMesh& operator=(const DrawnMesh&) = delete;

  // Call before each image.
  void begin_image();

  bool empty() const { return faces_.empty(); }
  const std::array<float, 6>& box() const {
    return box_;
  }  // of all vertices: centre, half sizes, m
  const MeshSurface* surface() const { return &surface_; }  // filled by prepare_surface()

  // What has been built.
  bool has_clusters() const { return clusters_ != nullptr; }
  bool has_tree() const { return tree_ != nullptr; }
  bool has_surface() const { return tables_ != nullptr; }

  bool has_uvs() const override;
  const rays::Clusters& clusters() override;
  const rays::Horizons& horizons() override;
  void* bvh() override;
  void* shadow_bvh() override;
  void prepare_surface(bool uvs) override;

 private:
  const rays::MeshArrays& arrays();
  std::shared_ptr<const MeshTables> hull_tables(bool coordinates) const;

  // Number of images with shadow rays after which a better tree for them is built, one mesh in an
  // image. Their results do not depend on the tree.
  static constexpr int kManyUses = 50;

  const mjModel* model_;
  int mesh_;
  bool hull_;
  std::span<const float> vertices_;
  std::span<const int> faces_;
  std::array<float, 6> box_;
  std::optional<rays::MeshArrays> arrays_;  // with the key of their contents in this image
  std::shared_ptr<const rays::Clusters> clusters_;
  std::shared_ptr<const rays::Horizons> horizons_;
  std::shared_ptr<const rays::MeshScene> tree_, better_tree_;
  std::shared_ptr<const MeshTables> tables_;
  MeshSurface surface_;
  int uses_ = 0;
  bool used_ = false;  // by shadow rays of this image
  bool& improved_;
};

}  // namespace mjsense::render
