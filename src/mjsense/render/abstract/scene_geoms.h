// SPDX-License-Identifier: Apache-2.0
#pragma once
// The geoms of an abstract scene, as they are drawn.

#include <span>
#include <utility>
#include <vector>

#include "mjsense/render/abstract/abstract_scene.h"
#include "mjsense/render/abstract/decorations.h"
#include "mjsense/render/abstract/scene_assets.h"
#include "mjsense/render/abstract/scene_camera.h"
#include "mjsense/render/abstract/scene_memory.h"
#include "mjsense/render/abstract/soft_geoms.h"
#include "mjsense/render/view/drawn_scene.h"

namespace mjsense::render {

class SceneGeoms {
 public:
  // What the geoms depend on besides the scene.
  struct Look {
    const SceneCamera& camera;
    float line_width;  // pixels
    float ambient;     // SceneLights::ambient()
    // For a colour image: with materials, and with geoms that have no segmentation id, which depth and
    // segmentation do not show.
    bool colored;
    bool physical;  // with the maps of physically based images
  };

  // `model` (model_of_arrays()) and `assets` must outlive this object.
  SceneGeoms(const mjModel* model, SceneAssets& assets, StructReader reader, const SoftArrays& soft)
      : model_(model), assets_(assets), reader_(std::move(reader)), soft_(model, assets, soft) {}

  // Throws ValueError for a geom whose values are not finite and for what cannot be drawn.
  void read(const SceneMemory& scene, const Look& look);
  const std::vector<DrawnGeom>& all() const { return drawn_; }

 private:
  void add(const AbstractGeom& geom, const SceneMemory& scene, const Look& look);
  void set_material(const AbstractGeom& geom, const Look& look, DrawnGeom& out);
  bool set_primitive_shape(const AbstractGeom& geom, rays::RayGeom& shape) const;
  bool set_mesh(const AbstractGeom& geom, DrawnGeom& out);
  bool set_height_field(const AbstractGeom& geom, DrawnGeom& out);

  const mjModel* model_;
  SceneAssets& assets_;
  StructReader reader_;
  SoftGeoms soft_;
  Decorations decorations_;
  std::vector<DrawnGeom> drawn_;
  std::vector<std::pair<int, int>> segments_;  // object id and type by segmentation id
};

}  // namespace mjsense::render
