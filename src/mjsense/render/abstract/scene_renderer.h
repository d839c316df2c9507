// SPDX-License-Identifier: Apache-2.0
#pragma once
// Images of an abstract scene (mjvScene) that any version of MuJoCo has filled.

#include <map>
#include <memory>
#include <vector>

#include "mjsense/rays/deformable_mesh.h"
#include "mjsense/render/abstract/abstract_scene.h"
#include "mjsense/render/abstract/decoration_shapes.h"
#include "mjsense/render/abstract/kept_images.h"
#include "mjsense/render/abstract/model_arrays.h"
#include "mjsense/render/abstract/scene_assets.h"
#include "mjsense/render/kernels/tile_memory.h"
#include "mjsense/render/path/environment_sampler.h"
#include "mjsense/render/view/view_builder.h"

namespace mjsense::render {

// Values of the model that MuJoCo's renderers read when they are made.
struct SceneSettings {
  int samples = 1;  // per pixel of rgb
  bool shadows = true;
  float shadow_clip = 0, shadow_scale = 0;  // m; relative to a spot light's cutoff
  float shadow_near = 0;                    // m
  float haze_width = 0, haze_rgb[3] = {};
  Fog fog;
  float line_width = 1;              // pixels
  bool projected_textures = false;   // DrawnScene::projected_textures
  bool sized_soft_textures = false;  // DrawnScene::sized_soft_textures
  // As in MuJoCo before 3.12, a point or image light shines from the camera's direction. Later
  // versions do not draw it.
  bool point_lights_at_camera = false;
};

// Arrays of an mjvScene that hold flexes and skins; null if there are none.
struct SoftArrays {
  int num_flexes = 0;
  const int *flexedgeadr = nullptr, *flexedgenum = nullptr, *flexedge = nullptr;
  const int *flexvertadr = nullptr, *flexvertnum = nullptr;
  const int *flexfaceadr = nullptr, *flexfaceused = nullptr;
  const float *flexvert = nullptr, *flexface = nullptr, *flexnormal = nullptr,
              *flextexcoord = nullptr;
  const int *skinfacenum = nullptr, *skinvertadr = nullptr, *skinvertnum = nullptr;
  const float *skinvert = nullptr, *skinnormal = nullptr;
};

// The memory of an mjvScene. Addresses are those of the structs' reference fields.
struct SceneMemory {
  const char* geoms;
  std::ptrdiff_t geom_stride;
  int num_geoms;
  const char* lights;
  std::ptrdiff_t light_stride;
  int num_lights;
  const char* cameras[2];
  bool shadow, reflection, skybox, haze, fog;  // flags mjRND_*
  bool flex_vertices, flex_edges, flex_skin;
  bool point_lights;  // draw point lights at their position, unlike MuJoCo
};

class SceneRenderer {
 public:
  // `arrays` must stay valid as long as the renderer.
  SceneRenderer(const NamedArrays& arrays, const SceneSettings& settings, StructReader geoms,
                StructReader lights, StructReader cameras, const SoftArrays& soft);
  ~SceneRenderer();

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
  struct Soft;
  struct Decoration;

  void read(const SceneMemory& scene, bool all);
  void add(const AbstractGeom& geom, const SceneMemory& scene, bool colored);
  void add_triangles(const DrawnGeom& like, ShapeTriangles triangles);
  void add_lines(const AbstractGeom& geom, const DrawnGeom& like);
  void add_flex(const AbstractGeom& geom, const DrawnGeom& like, const SceneMemory& scene);
  void add_skin(const AbstractGeom& geom, const DrawnGeom& like);
  void read_lights(const SceneMemory& scene);
  void read_camera(const SceneMemory& scene, int width, int height);
  void trace_paths(const View& view, std::uint8_t* rgb);

  std::unique_ptr<mjModel> model_;
  std::unique_ptr<mjModel> indices_;  // model_ with what only MuJoCo reads
  SceneSettings settings_;
  PhysicalOptions physical_;
  StructReader geom_reader_, light_reader_, camera_reader_;
  SoftArrays soft_;
  SceneAssets assets_;
  std::shared_ptr<RTCDeviceTy> device_;
  // The current scene.
  std::vector<DrawnGeom> drawn_;
  std::vector<std::pair<int, int>> segments_;  // object id and type by segmentation id
  std::vector<ViewLight> lights_;
  std::vector<float> intensities_, ranges_;  // by light
  Rgb64 environment_tint_;
  double position_[3], rotation_[9];
  PixelGrid grid_;
  float near_ = 0, far_ = 0;
  std::map<int, std::unique_ptr<Soft>> skins_;
  std::map<std::pair<int, int>, std::unique_ptr<Soft>> flexes_;  // by flex and first face
  std::vector<std::unique_ptr<Decoration>> decorations_;
  // Working memory for up to `capacity_` geoms.
  std::size_t capacity_ = 0;
  std::unique_ptr<ViewBuilder> builder_;
  std::unique_ptr<TileMemory> memory_;
  RenderTiles tiles_ = best_render_tiles();
  KeptImages kept_;
  std::shared_ptr<const Environment> around_;  // the environment of `sampler_`
  std::shared_ptr<const EnvironmentSampler> sampler_;
};

}  // namespace mjsense::render
