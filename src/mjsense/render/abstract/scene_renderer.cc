// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/scene_renderer.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "mjsense/core/model_indices.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/render/path/path_tracer.h"

namespace mjsense::render {
namespace {

// Depth that mujoco.Renderer gives where nothing is seen: the far plane's, with the error of single
// precision that its conversion has.
float far_depth(float near, float far, bool orthographic) {
  if (orthographic) return far;
  const float c = -0.5f * (-(far + near) / (far - near)) - 0.5f;
  const float d = -0.5f * (-(2.0f * far * near) / (far - near));
  return static_cast<float>(static_cast<double>(d) / c);
}

}  // namespace

SceneRenderer::SceneRenderer(const NamedArrays& arrays, const SceneSettings& settings,
                             StructReader geoms, StructReader lights, StructReader cameras,
                             const SoftArrays& soft)
    : model_(model_of_arrays(arrays)),
      indices_(indices_of_arrays(arrays, *model_)),
      settings_(settings),
      camera_reader_(std::move(cameras)),
      assets_(model_.get()),
      lights_(std::move(lights)),
      geoms_(model_.get(), assets_, std::move(geoms), soft) {}

void SceneRenderer::check_indices() const { check_element_indices(*indices_); }

void SceneRenderer::render(const SceneMemory& scene, int width, int height,
                           const ImageTargets& targets) {
  check_indices();
  if (assets_.begin_image()) kept_.clear();
  camera_ = read_camera(camera_reader_, scene, width, height);
  lights_.read(scene, settings_, camera_);
  if (targets.rgb) {
    ImageTargets images = targets;
    images.depth = nullptr;
    images.segmentation = nullptr;
    images.samples = static_cast<int>(std::bit_floor(
        static_cast<unsigned>(std::clamp(settings_.samples, 1, ImageTargets::kMaxMultisamples))));
    images.multisampled = images.samples > 1;
    draw(scene, images);
  }
  if (targets.depth || targets.segmentation) {
    ImageTargets images = targets;
    images.rgb = nullptr;
    draw(scene, images);
    if (targets.depth)
      std::replace(targets.depth, targets.depth + static_cast<std::size_t>(width) * height, 0.0f,
                   far_depth(camera_.near, camera_.far, camera_.grid.orthographic));
  }
}

void SceneRenderer::draw(const SceneMemory& scene, const ImageTargets& images) {
  const bool colored = images.rgb != nullptr;
  geoms_.read(scene, {.camera = camera_,
                      .line_width = settings_.line_width,
                      .ambient = lights_.ambient(),
                      .colored = colored,
                      .physical = physical_.on});
  if (geoms_.all().size() > capacity_ || !view_) {
    capacity_ = std::bit_ceil(std::max<std::size_t>(geoms_.all().size(), 64));
    view_ = std::make_unique<DrawnSceneView>(capacity_, kClassicLights);
    memory_ = std::make_unique<TileMemory>(static_cast<int>(capacity_));
  }
  const float* haze = settings_.haze_rgb;
  const DrawnScene drawn{
      .geoms = geoms_.all(),
      .lights = lights_.lights(),
      .near = camera_.near,
      .far = camera_.far,
      .shadows = colored && scene.shadow && settings_.shadows,
      .reflections = colored && scene.reflection,
      .skybox = colored && scene.skybox ? assets_.skybox() : nullptr,
      .sky = {0.7f * camera_.far, settings_.haze_width, {haze[0], haze[1], haze[2]}},
      .haze = scene.haze,
      .fog = scene.fog ? settings_.fog : Fog{},
      .projected_textures = settings_.projected_textures,
      .sized_soft_textures = settings_.sized_soft_textures,
      .physical = colored && physical_.on ? &physical_ : nullptr,
      .intensities = lights_.intensities(),
      .ranges = lights_.ranges(),
      .environment_tint = lights_.environment_tint()};
  const View& view = view_->build(drawn, camera_.position, camera_.rotation, camera_.grid);
  if (view.physical.all_geoms) {
    trace_paths(view, images.rgb);
  } else {
    kept_.render(view, images, tiles_, memory_->scratch());
  }
}

void SceneRenderer::trace_paths(const View& view, std::uint8_t* rgb) {
  // Meshes and textures that are prepared on demand belong to one thread.
  const auto prepare = [](const Texture* texture) {
    if (texture && texture->on_demand) texture->on_demand->add_level(0);
  };
  prepare(view.skybox);
  for (int i = 0; i < view.num_geoms; ++i) {
    const ViewGeom& g = view.geoms[i];
    if (g.mesh_on_demand) g.mesh_on_demand->prepare_surface(g.surface.uses_mesh_uvs);
    prepare(g.surface.texture);
    for (const Texture* map : g.surface.maps) prepare(map);
  }
  if (around_ != physical_.environment) {
    sampler_ = std::make_shared<const EnvironmentSampler>(physical_.environment->light);
    around_ = physical_.environment;
  }
  PathTracer paths(physical_.path_samples, sampler_);
  paths.build(view);
  ThreadPool(0).run((view.grid.height + kTileSize - 1) / kTileSize,
                    [&](int row, int) { paths.render(row, row + 1, {.rgb = rgb}); });
}

}  // namespace mjsense::render
