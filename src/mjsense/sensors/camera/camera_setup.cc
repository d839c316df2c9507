// SPDX-License-Identifier: Apache-2.0
// The initialisation of CameraSensor.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "mjsense/core/error.h"
#include "mjsense/core/shared_cache.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/sensors/camera/camera_data.h"
#include "mjsense/sensors/camera/camera_sensor.h"
#include "mjsense/sensors/camera/camera_workspace.h"
#include "mjsense/sensors/camera/physical_options.h"

namespace mjsense::sensors {
namespace {

unsigned bits_of(const std::vector<int>& groups) {
  unsigned bits = 0;
  for (int g : groups) bits |= 1u << g;
  return bits;
}

render::MarkerOptions marker_options(const CameraSensorCfg& cfg) {
  return {bits_of(cfg.enabled_site_groups), bits_of(cfg.enabled_tendon_groups), cfg.use_textures};
}

render::ViewOptions view_options(const CameraSensorCfg& cfg, bool colors, double near, double far) {
  render::ViewOptions options;
  options.groups = bits_of(cfg.enabled_geom_groups);
  options.textures = cfg.use_textures;
  options.shadows = cfg.use_shadows && colors;
  options.shadow_samples = cfg.shading == Shading::kPath ? 1 : cfg.shadow_samples;
  options.reflections = colors;
  options.near = static_cast<float>(near);
  options.far = static_cast<float>(far);
  return options;
}

// Cameras of one simulation share what they do not change.
std::shared_ptr<const render::SurfaceAssets> surface_assets_of(const SensorInit& init, bool meshes,
                                                               bool textures) {
  const auto make = [&] {
    return std::make_shared<const render::SurfaceAssets>(init.model, meshes, textures);
  };
  if (init.shared == nullptr) return make();
  return init.shared->get<render::SurfaceAssets>(
      fmt::format("surface assets {} {}", meshes, textures), make);
}

}  // namespace

void CameraSensor::initialize(const SensorInit& init) {
  model_ = init.model;
  find_camera();
  set_clip_planes();
  assets_ = surface_assets_of(init, colored() || wants("normals"), colored() && cfg_.use_textures);
  clear_fields();
  declare_fields(init.num_worlds);
  worlds_.assign(init.num_worlds, PerWorld{{},
                                           render::Appearance(model_, cfg_.max_lights),
                                           render::Markers(model_, marker_options(cfg_))});
  due_.reserve(init.num_worlds);
  prepare_grids(init);
  owners_.reset();
  if (bodies_ || entities_) owners_ = std::make_unique<PixelOwners>(init, cfg_.width, cfg_.height);
  clean_.clear();
  if (cfg_.depth_noise != DepthNoise::kNone)
    clean_.assign(init.threads,
                  std::vector<float>(static_cast<std::size_t>(cfg_.width) * cfg_.height));
  prepare_motion(init);
  gl_.reset();
  workspace_.reset();
  if (cfg_.renderer == CameraRenderer::kOpenGl) {
    gl_ = make_gl_renderer(init.num_worlds);
  } else {
    prepare_layers(init.num_worlds);
    allocate_workspace(init);
  }
}

void CameraSensor::find_camera() {
  const std::string& camera = cfg_.camera_name.empty() ? name() : cfg_.camera_name;
  camera_ = mj_name2id(model_, mjOBJ_CAMERA, camera.c_str());
  if (camera_ < 0)
    throw_unknown(context(), "camera", camera, scene::model_names(model_, mjOBJ_CAMERA));
}

void CameraSensor::set_clip_planes() {
  const auto plane = [&](ClipPlane clip, double at, double of_model) {
    return clip == ClipPlane::kModel ? of_model * model_->stat.extent : at;
  };
  near_ = plane(cfg_.clip_near, cfg_.near, model_->vis.map.znear);
  far_ = plane(cfg_.clip_far, cfg_.far, model_->vis.map.zfar);
  if (far_ > 0 && far_ <= near_)
    throw ValueError(
        fmt::format("{}: clips at near {:.6g} m and far {:.6g} m ('model': znear and zfar times "
                    "the extent {:.6g} m): need near < far",
                    context(), near_, far_, model_->stat.extent));
}

// Sets the worlds' pixel rays, with the lens distortion, and what computes optical flow from them.
void CameraSensor::prepare_grids(const SensorInit& init) {
  render::PixelGrid grid = grid_in(model_);
  check_grid(grid);
  std::optional<LensModel> lens;
  if (cfg_.distortion.model != LensKind::kNone) {
    lens = {cfg_.distortion.model == LensKind::kFisheye ? render::Lens::kFisheye
                                                        : render::Lens::kBrownConrady,
            cfg_.distortion.coefficients};
    distorted_rays_ =
        render::distorted_rays(grid, lens->lens, lens->coefficients, context().c_str());
    grid.distorted_rays = distorted_rays_.data();
  }
  for (PerWorld& w : worlds_) w.grid = grid;
  optical_flow_.reset();
  if (wants("flow"))
    optical_flow_ = std::make_unique<OpticalFlow>(model_, camera_, lens, cfg_.update_period > 0,
                                                  grid, init.num_worlds, init.threads);
}

std::unique_ptr<render::GlRenderer> CameraSensor::make_gl_renderer(int num_worlds) const {
  render::GlRendererCfg gl;
  gl.num_worlds = num_worlds;
  gl.camera = camera_;
  gl.width = cfg_.width;
  gl.height = cfg_.height;
  gl.groups = bits_of(cfg_.enabled_geom_groups);
  gl.textures = cfg_.use_textures;
  gl.shadows = cfg_.use_shadows;
  gl.samples = cfg_.samples;
  gl.max_lights = cfg_.max_lights;
  gl.markers = max_markers();
  if (!cfg_.camera_name.empty()) {
    gl.fovy = cfg_.fovy;
    gl.orthographic = cfg_.orthographic;
  }
  return render::make_gl_renderer(model_, gl, context());
}

void CameraSensor::prepare_motion(const SensorInit& init) {
  motion_.reset();
  const std::optional<ImagerCfg> imager = imager_of(cfg_);
  if (rgb_ && imager && cfg_.motion_samples > 0)
    motion_ = std::make_unique<CameraMotion>(model_, cfg_, *imager, marker_options(cfg_),
                                             init.num_worlds, init.threads, context());
}

// Prepares the parts of images that are kept for later ones, where the camera cannot move.
void CameraSensor::prepare_layers(int num_worlds) {
  const bool fixed =
      cfg_.shading != Shading::kPath && render::FixedLayer::possible(model_, camera_);
  changed_tiles_.clear();
  // The other fields follow from images that are not stored. If something may move during an
  // exposure, the tiles are those of its instants.
  if (fixed && (motion_ || (!optical_flow_ && !owners_ && clean_.empty())))
    changed_tiles_.resize(num_worlds);
  fixed_layers_.reset();
  if (colored() && cfg_.samples == 1 && fixed)
    fixed_layers_ =
        std::make_unique<render::FixedLayers>(model_, cfg_.width, cfg_.height, num_worlds);
}

// Allocates all that cast() needs, except the shapes of the ray scene and the last views.
void CameraSensor::allocate_workspace(const SensorInit& init) {
  const int slots =
      std::max(init.threads, std::min(init.num_worlds, kImagesPerThread * init.threads));
  workspace_ = std::make_unique<Workspace>();
  workspace_->builders.reserve(slots);
  workspace_->making.resize(slots);
  render::ViewOptions options = view_options(cfg_, colored(), near_, far_);
  options.markers = max_markers();
  if (colored()) options.physical = physical_options(cfg_, model_);
  response_.reset();
  if (rgb_ && needs_response(cfg_)) {
    response_ = std::make_unique<CameraResponse>(cfg_, options.physical, init.num_worlds);
    if (motion_ || !hdr_) response_->keep_radiance();
  }
  options.layered = fixed_layers_ != nullptr;
  for (int i = 0; i < slots; ++i) workspace_->builders.emplace_back(model_, *assets_, options);
  if (options.physical.path_samples > 0) {
    const auto around =
        std::make_shared<const render::EnvironmentSampler>(options.physical.environment->light);
    for (int i = 0; i < slots; ++i)
      workspace_->paths.emplace_back(options.physical.path_samples, around);
  }
  const int geoms = static_cast<int>(render::ViewBuilder::max_geoms(model_) + options.markers);
  for (int i = 0; i < init.threads; ++i) workspace_->memory.emplace_back(geoms);
}

std::size_t CameraSensor::max_markers() const {
  return worlds_.empty() ? 0 : worlds_[0].markers.capacity();
}

// Checks that need the camera of the model, in addition to validate().
void CameraSensor::check_grid(const render::PixelGrid& grid) const {
  const bool orthographic = model_->cam_projection[camera_] == mjPROJ_ORTHOGRAPHIC;
  if (cfg_.fovy && !grid.orthographic) check_fovy(*cfg_.fovy, context());
  if (orthographic && (cfg_.intrinsics || cfg_.distortion.model != LensKind::kNone))
    throw ValueError(context() +
                     ": an orthographic camera has no intrinsics and no lens distortion");
  if (orthographic && cfg_.depth_noise != DepthNoise::kNone)
    throw ValueError(context() +
                     ": depth_noise applies only to the planar depth of a perspective camera");
}

void CameraSensor::declare_fields(int num_worlds) {
  const std::int64_t h = cfg_.height, w = cfg_.width;
  const std::string frame =
      fmt::format("camera {}", cfg_.camera_name.empty() ? name() : cfg_.camera_name);
  const auto add = [&](const char* field, Shape shape, double low, double high,
                       Storage storage = Storage::kArray) {
    SensorSpec spec = kCameraData.spec(field, shape, frame);
    spec.low = low;
    spec.high = high;
    spec.storage = storage;
    return &add_field(field, spec, num_worlds);
  };
  constexpr double inf = std::numeric_limits<double>::infinity();
  rgb_ = hdr_ = depth_ = segmentation_ = bodies_ = entities_ = normals_ = points_ = flow_ = nullptr;
  if (wants("rgb")) rgb_ = add("rgb", {h, w, 3}, 0, 255, Storage::kRgbVideo);
  if (wants("hdr")) hdr_ = add("hdr", {h, w, 3}, 0, inf);
  if (wants("depth")) {
    depth_ = add("depth", {h, w, 1}, 0, inf, Storage::kDepthVideo);
    if (cfg_.depth_kind == DepthKind::kRay)
      depth_->spec.description = "Distance along each pixel's ray; 0 where nothing is seen.";
  }
  if (wants("segmentation")) segmentation_ = add("segmentation", {h, w, 2}, -1, inf);
  if (wants("body_segmentation"))
    bodies_ = add("body_segmentation", {h, w, 1}, -1, model_->nbody - 1);
  if (wants("entity_segmentation")) entities_ = add("entity_segmentation", {h, w, 1}, -1, inf);
  if (wants("normals")) normals_ = add("normals", {h, w, 3}, -1, 1);
  if (wants("point_cloud")) points_ = add("point_cloud", {h, w, 3}, -inf, inf);
  if (wants("flow")) flow_ = add("flow", {h, w, 2}, -inf, inf);
  intrinsics_ = add("intrinsics", {3, 3}, -inf, inf);
  pose_ = add("pose", {4, 4}, -inf, inf);
  pose_->spec.frame = "world";
}

}  // namespace mjsense::sensors
