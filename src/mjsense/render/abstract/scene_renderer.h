// SPDX-License-Identifier: Apache-2.0
#pragma once
// Images of an abstract scene (mjvScene) that any version of MuJoCo has filled.

#include <memory>

#include "mjsense/render/abstract/abstract_scene.h"
#include "mjsense/render/abstract/kept_images.h"
#include "mjsense/render/abstract/model_arrays.h"
#include "mjsense/render/abstract/scene_assets.h"
#include "mjsense/render/abstract/scene_camera.h"
#include "mjsense/render/abstract/scene_geoms.h"
#include "mjsense/render/abstract/scene_lights.h"
#include "mjsense/render/abstract/scene_memory.h"
#include "mjsense/render/kernels/tile_memory.h"
#include "mjsense/render/path/environment_sampler.h"
#include "mjsense/render/view/drawn_scene_view.h"
#include "mjsense/render/view/physical_light.h"

namespace mjsense::render {

class SceneRenderer {
 public:
  // `arrays` must stay valid as long as the renderer.
  SceneRenderer(const NamedArrays& arrays, const SceneSettings& settings, StructReader geoms,
                StructReader lights, StructReader cameras, const SoftArrays& soft);
  SceneRenderer(const SceneRenderer&) = delete;
  SceneRenderer& operator=(const SceneRenderer&) = delete;

  // Renders the scene's current contents. Throws ValueError for a geom or camera whose pose is not
  // finite and for what cannot be drawn.
  void render(const SceneMemory& scene, int width, int height, const ImageTargets& targets);

  // Throws ValueError if the program has written an id or address into the model that is out of range.
  void check_indices() const;

  // Makes the next image show the current contents of meshes, height fields and textures.
  void reload() {
    assets_.reload();
    kept_.clear();
  }
  PreparedAssets prepared() const { return assets_.prepared(); }
  // The arrays that an image depends on.
  const mjModel* model() const { return model_.get(); }
  void set_physical(const PhysicalOptions& options) { physical_ = options; }

 private:
  // Renders rgb, or depth and segmentation.
  void draw(const SceneMemory& scene, const ImageTargets& images);
  void trace_paths(const View& view, std::uint8_t* rgb);

  std::unique_ptr<mjModel> model_;
  std::unique_ptr<mjModel> indices_;  // model_ with what only MuJoCo reads
  SceneSettings settings_;
  PhysicalOptions physical_;
  StructReader camera_reader_;
  SceneAssets assets_;
  // The current scene.
  SceneCamera camera_;
  SceneLights lights_;
  SceneGeoms geoms_;
  // Working memory for up to `capacity_` geoms.
  std::size_t capacity_ = 0;
  std::unique_ptr<DrawnSceneView> view_;
  std::unique_ptr<TileMemory> memory_;
  RenderTiles tiles_ = best_render_tiles();
  KeptImages kept_;
  std::shared_ptr<const Environment> around_;  // the environment of `sampler_`
  std::shared_ptr<const EnvironmentSampler> sampler_;
};

}  // namespace mjsense::render
