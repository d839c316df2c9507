// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/camera_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/shared_cache.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/render/kernels/tile_memory.h"
#include "mjsense/render/path/path_tracer.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/sensors/camera/camera_data.h"
#include "mjsense/sensors/camera/depth_noise.h"
#include "mjsense/sensors/camera/physical_options.h"

namespace mjsense::sensors {
namespace {

// If there are fewer images per thread than this, images are divided into bands. There are enough
// bands for all threads to finish at about the same time.
constexpr int kImagesPerThread = 4, kBandsPerThread = 16;

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

// Working memory of cast(). With few large images, each has a view, whose tiles are divided among
// the threads. With many small ones, each thread has a view.
struct CameraSensor::Workspace {
  std::vector<render::ViewBuilder> builders;
  // By builder: tiles of the fixed layer that must be rendered before the image; null: none.
  std::vector<render::FixedTile*> making;
  std::vector<render::TileMemory> memory;  // by thread
  std::vector<render::PathTracer> paths;   // by builder; empty: images are not path-traced
  render::RenderTiles render = render::best_render_tiles();
};

CameraSensor::CameraSensor(const CameraSensorCfg& cfg) : Sensor(cfg.name), cfg_(cfg) {
  validate(cfg);
}

CameraSensor::~CameraSensor() = default;

bool CameraSensor::wants(std::string_view type) const {
  return std::find(cfg_.data_types.begin(), cfg_.data_types.end(), type) != cfg_.data_types.end();
}

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

std::string CameraSensor::context() const { return fmt::format("camera '{}'", name()); }

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

// The camera of the world's `model`, with this configuration's changes, which do not affect other
// sensors of the same camera.
render::PixelGrid CameraSensor::grid_in(const mjModel* model) const {
  const int w = cfg_.width, h = cfg_.height;
  if (cfg_.intrinsics) {
    const CameraIntrinsics& k = *cfg_.intrinsics;
    return render::grid_from_intrinsics(w, h, k.fx, k.fy, k.cx, k.cy);
  }
  const bool wrapped = !cfg_.camera_name.empty();
  if (!wrapped || (!cfg_.fovy && !cfg_.orthographic))
    return render::grid_of_camera(model, camera_, w, h);
  const bool orthographic =
      cfg_.orthographic || model->cam_projection[camera_] == mjPROJ_ORTHOGRAPHIC;
  return render::grid_from_fovy(w, h, cfg_.fovy.value_or(model->cam_fovy[camera_]), orthographic);
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

// Image n is due from phase + n * period on; the first one is also due before that, and at a reset.
bool CameraSensor::is_due(const World& world, std::int64_t& image) const {
  if (cfg_.update_period <= 0) return true;
  // The tolerance avoids that rounding delays an image that is due exactly now.
  const double passed = (world.time() - cfg_.phase) / cfg_.update_period + 1e-6;
  const auto n = std::max<std::int64_t>(-1, static_cast<std::int64_t>(std::floor(passed)));
  const bool due = world.first || n != image;
  image = n;
  return due;
}

void CameraSensor::reset(const World& world) {
  if (optical_flow_) optical_flow_->reset(world.id);
  if (response_) response_->reset(world.id);
  if (motion_) motion_->clear(world.id);
}

void CameraSensor::compute(const World& world) {
  PerWorld& w = worlds_[world.id];
  if (motion_) motion_->remember(world);
  w.due |= is_due(world, w.image);  // an image that was due but not rendered is still due
  if (!w.due) return;
  const mjModel* m = world.model;
  if (!w.grid.distorted_rays) w.grid = grid_in(m);
  if (gl_) {
    gl_->remember(world.id, m);
  } else {
    w.appearance.copy(m);
  }
  w.markers.copy(m, world.data);  // poses of sites, paths of tendons
  if (optical_flow_) optical_flow_->take(world, w.grid);
  w.rng = world.rng(stream_of(name()));
  w.colour_rng = world.rng(stream_of(name() + "/rgb"));
  w.time = world.data->time;  // of the state, which a recording keeps
  std::ranges::copy(render::intrinsic_matrix(w.grid),
                    intrinsics_->data.row<float>(world.id).begin());
  const double* p = world.data->cam_xpos + 3 * camera_;
  const double* r = world.data->cam_xmat + 9 * camera_;
  std::span<float> pose = pose_->data.row<float>(world.id);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) pose[4 * i + j] = static_cast<float>(r[3 * i + j]);
    pose[4 * i + 3] = static_cast<float>(p[i]);
    pose[12 + i] = 0;
  }
  pose[15] = 1;
}

// Targets in the fields of this world; buffers of this thread for those that only derive() needs.
render::ImageTargets CameraSensor::targets(int world, int thread) {
  render::ImageTargets t;
  t.samples = cfg_.samples;
  if (instant_ >= 0) {
    t.hdr = motion_->image(world);
    return t;
  }
  if (response_) {
    if (!motion_) t.hdr = response_->radiance(world);
  } else if (rgb_) {
    t.rgb = rgb_->data.row<std::uint8_t>(world).data();
  }
  if (hdr_) t.hdr = hdr_->data.row<float>(world).data();
  if (depth_) t.depth = depth_->data.row<float>(world).data();
  if (segmentation_) t.segmentation = segmentation_->data.row<std::int32_t>(world).data();
  if (normals_) t.normals = normals_->data.row<float>(world).data();
  if (points_) t.points = points_->data.row<float>(world).data();
  t.depth_along_ray = cfg_.depth_kind == DepthKind::kRay;
  if (optical_flow_) optical_flow_->complete(t, thread);
  if (owners_) owners_->complete(t, thread);
  return t;
}

const render::View& CameraSensor::build_view(const CastContext& context, int world,
                                             render::ViewBuilder& builder, int thread) const {
  const PerWorld& w = worlds_[world];
  const bool present = instant_ < 0 || motion_->instants(world) == 1;
  const CameraMotion::Scene scene =
      present ? CameraMotion::Scene{context.rays->world(world), w.markers.all()}
              : motion_->at(world, instant_, thread);
  const rays::RayCamera& camera = scene.state.cameras()[camera_];
  const render::View& view = builder.build(scene.state, context.rays->shared(), w.appearance,
                                           scene.markers, camera.pos, camera.mat, w.grid);
  if (fixed_layers_) builder.use_fixed(fixed_layers_->find(world, view));
  if (!workspace_->paths.empty())
    workspace_->paths[&builder - workspace_->builders.data()].build(view);
  return view;
}

void CameraSensor::make_fixed(const render::View& view, render::FixedTile* tiles, int first,
                              int last, int thread) {
  render::ImageTargets targets;
  targets.fixed_tiles = tiles;
  workspace_->render(view, targets, first, last, workspace_->memory[thread].scratch());
}

void CameraSensor::settle_common_layer(const CastContext& context, int world, int tile_rows) {
  const render::View& view = build_view(context, world, workspace_->builders[0], 0);
  render::FixedTile* tiles = fixed_layers_->settle_common(world, view);
  if (!tiles) return;
  context.pool.run(tile_rows,
                   [&](int row, int thread) { make_fixed(view, tiles, row, row + 1, thread); });
}

render::FixedTile* CameraSensor::settle_layer(int world, const render::View& view) {
  return fixed_layers_ && !view.fixed_tiles ? fixed_layers_->settle(world, view) : nullptr;
}

void CameraSensor::cast(const CastContext& context) {
  due_.clear();
  for (int id : context.ids)
    if (worlds_[id].due) due_.push_back(id);
  if (motion_) expose(context);
  // rgb, intrinsics and pose: an exposed image has no others
  if (!motion_ || fields().size() > 3) render_images(context, due_);
  if (response_) develop(context);
  if (!clean_.empty()) add_noise(context);
  for (int id : due_) worlds_[id].due = false;
}

void CameraSensor::develop(const CastContext& context) {
  context.pool.run(static_cast<int>(due_.size()), [&](int item, int) {
    const int id = due_[item];
    const PerWorld& w = worlds_[id];
    response_->develop(
        id, w.time, w.grid, w.colour_rng,
        hdr_ && !motion_ ? hdr_->data.row<float>(id).data() : response_->radiance(id),
        rgb_->data.row<std::uint8_t>(id).data());
  });
}

void CameraSensor::add_noise(const CastContext& context) {
  const StereoCamera camera = stereo_preset(cfg_.depth_noise);
  context.pool.run(static_cast<int>(due_.size()), [&](int item, int thread) {
    const int id = due_[item];
    add_stereo_noise(camera, depth_->data.row<float>(id), cfg_.width, 1.0 / worlds_[id].grid.dx,
                     worlds_[id].rng, clean_[thread]);
  });
}

void CameraSensor::render_rows(int slot, int world, int first, int last, int thread) {
  const render::View& view = workspace_->builders[slot].view();
  render::ImageTargets image = targets(world, thread);
  const int height = cfg_.height, size = render::kTileSize;
  if (instant_ >= 0) {
    const CameraMotion::Rows rows = motion_->rows(world, instant_);
    first = std::max(first, rows.first / size);
    last = std::min(last, (rows.last + size - 1) / size);
    if (first >= last) return;
  }
  if (!workspace_->paths.empty() && (image.rgb || image.hdr)) {
    workspace_->paths[slot].render(first, last, image);
    image.rgb = nullptr;
    image.hdr = nullptr;
  }
  if (render::ChangedTiles* tiles = changed_tiles(world)) {
    image.changed_tiles = tiles->changed();
    image.receivers = tiles->receivers();
  }
  if (instant_ < 0) {
    workspace_->render(view, image, first, last, workspace_->memory[thread].scratch());
    derive(world, image, first * size, std::min(last * size, height));
    return;
  }
  // Only rows of tiles that show the instant before have other tiles that are kept.
  const CameraMotion::Rows before = motion_->rendered(world);
  for (int row = first; row < last && image.hdr; ++row) {
    render::ImageTargets part = image;
    if (before.first >= (row + 1) * size || before.last <= row * size) part.changed_tiles = nullptr;
    workspace_->render(view, part, row, row + 1, workspace_->memory[thread].scratch());
  }
  motion_->add(world, instant_, first * size, last * size, response_->radiance(world));
}

// Computes the fields that follow from depth and ids, for pixel rows [first, last).
void CameraSensor::derive(int world, const render::ImageTargets& image, int first, int last) {
  if (optical_flow_)
    optical_flow_->write(world, image, first, last, flow_->data.row<float>(world).data());
  if (owners_) {
    const auto row = [&](Field* field) {
      return field ? field->data.row<std::int32_t>(world).data() : nullptr;
    };
    owners_->write(image, first * cfg_.width, last * cfg_.width, row(bodies_), row(entities_));
  }
}

void CameraSensor::expose(const CastContext& context) {
  int instants = 0;
  for (int id : due_)
    instants = std::max(instants,
                        motion_->plan(context, id, response_->exposure_time(id, worlds_[id].time)));
  for (instant_ = instants - 1; instant_ >= 0; --instant_) {
    exposed_.clear();
    for (int id : due_)
      if (motion_->instants(id) > instant_) exposed_.push_back(id);
    render_images(context, exposed_);
    for (int id : exposed_) motion_->keep(id, instant_);
  }
}

void CameraSensor::render_images(const CastContext& context, std::span<const int> images) {
  if (gl_) {
    for (int id : images) {
      const render::ImageTargets image = targets(id, 0);
      gl_->render(id, context.rays->world(id), worlds_[id].markers.geoms(), image);
      derive(id, image, 0, cfg_.height);
    }
    return;
  }
  const int count = static_cast<int>(images.size());
  if (count == 0) return;
  const int tile_rows = (cfg_.height + render::kTileSize - 1) / render::kTileSize;
  const int threads = context.pool.size();
  Workspace& work = *workspace_;
  if (fixed_layers_) settle_common_layer(context, images[0], tile_rows);
  if (threads == 1 || count >= kImagesPerThread * threads) {
    context.pool.run(count, [&](int item, int thread) {
      render::ViewBuilder& builder = work.builders[thread];
      const render::View& view = build_view(context, images[item], builder, thread);
      render::ChangedTiles* changed = changed_tiles(images[item]);
      if (changed) changed->compare(view);
      if (render::FixedTile* tiles = settle_layer(images[item], view)) {
        make_fixed(view, tiles, 0, tile_rows, thread);
        builder.use_fixed(tiles);
      }
      render_rows(thread, images[item], 0, tile_rows, thread);
      if (changed) changed->keep(view);
    });
    return;
  }
  const int bands = std::clamp(kBandsPerThread * threads / std::max(count, 1), 1, tile_rows);
  // body(image, first row of tiles, row after the last, thread)
  const auto run_bands = [&](auto body) {
    context.pool.run(count * bands, [&](int item, int thread) {
      const int image = item / bands, band = item % bands;
      body(image, band * tile_rows / bands, (band + 1) * tile_rows / bands, thread);
    });
  };
  context.pool.run(count, [&](int item, int thread) {
    const render::View& view = build_view(context, images[item], work.builders[item], thread);
    if (render::ChangedTiles* changed = changed_tiles(images[item])) changed->compare(view);
    work.making[item] = settle_layer(images[item], view);
  });
  const auto making = std::span(work.making).first(count);
  if (std::ranges::any_of(making, [](render::FixedTile* tiles) { return tiles != nullptr; })) {
    run_bands([&](int image, int first, int last, int thread) {
      if (making[image])
        make_fixed(work.builders[image].view(), making[image], first, last, thread);
    });
    for (int i = 0; i < count; ++i)
      if (making[i]) work.builders[i].use_fixed(making[i]);
  }
  run_bands([&](int image, int first, int last, int thread) {
    render_rows(image, images[image], first, last, thread);
  });
  if (!changed_tiles(images[0])) return;
  context.pool.run(
      count, [&](int item, int) { changed_tiles(images[item])->keep(work.builders[item].view()); });
}

}  // namespace mjsense::sensors
