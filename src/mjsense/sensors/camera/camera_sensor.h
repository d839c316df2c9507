// SPDX-License-Identifier: Apache-2.0
#pragma once
// The sensor that CameraSensorCfg builds.

#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/render/opengl/gl_renderer.h"
#include "mjsense/render/view/camera_model.h"
#include "mjsense/render/view/changed_tiles.h"
#include "mjsense/render/view/fixed_layer.h"
#include "mjsense/render/view/markers.h"
#include "mjsense/render/view/surface_assets.h"
#include "mjsense/render/view/view_builder.h"
#include "mjsense/sensors/camera/camera_motion.h"
#include "mjsense/sensors/camera/camera_response.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense/sensors/camera/optical_flow.h"
#include "mjsense/sensors/camera/pixel_owners.h"

namespace mjsense::sensors {

// Throws ValueError for errors that can be found without a model.
void validate(const CameraSensorCfg& cfg);
// Throws ValueError for 180 degrees or more.
void check_fovy(double degrees, std::string_view context);

class CameraSensor final : public Sensor {
 public:
  explicit CameraSensor(const CameraSensorCfg& cfg);
  ~CameraSensor() override;

  std::string_view kind() const override { return "camera"; }
  Stage stage() const override { return Stage::kCast; }
  mjtStage needs() const override { return mjSTAGE_POS; }
  // A camera with its own rate must process every control step, because between two images it shows
  // the older one.
  bool needs_every_step() const override { return cfg_.update_period > 0; }
  bool wants_substep() const override { return motion_ != nullptr; }
  void substep(const World& world) override { motion_->remember(world); }
  void edit_spec(mjSpec* spec) override;
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;
  void cast(const CastContext& context) override;
  void reset(const World& world) override;
  bool debug_vis() const override { return cfg_.debug_vis; }
  void draw(const World& world, DebugShapes& shapes) override;

  const CameraSensorCfg& cfg() const { return cfg_; }

 private:
  struct Workspace;
  struct PerWorld {
    render::PixelGrid grid;
    render::Appearance appearance;
    render::Markers markers;
    std::int64_t image = -1;  // number of the current image, if there is an update period
    bool due = false;
    Rng rng{0, 0, 0, 0};  // at the time of the image
    Rng colour_rng{0, 0, 0, 0};
    double time = 0;  // s, of the state
  };
  std::string context() const;  // for errors: "camera 'NAME'"
  bool wants(std::string_view type) const;
  bool colored() const { return wants("rgb") || wants("hdr"); }
  // The parts of initialize(), in order.
  void find_camera();
  void set_clip_planes();
  void prepare_grids(const SensorInit& init);
  std::unique_ptr<render::GlRenderer> make_gl_renderer(int num_worlds) const;
  void prepare_motion(const SensorInit& init);
  void prepare_layers(int num_worlds);
  void allocate_workspace(const SensorInit& init);
  std::size_t max_markers() const;  // of a world
  void declare_fields(int num_worlds);
  // Renders the radiance of the due images of an image sensor, instant by instant.
  void expose(const CastContext& context);
  // Renders images of these worlds at instant_.
  void render_images(const CastContext& context, std::span<const int> images);
  void render_whole(const CastContext& context, std::span<const int> images, int tile_rows);
  void render_in_bands(const CastContext& context, std::span<const int> images, int tile_rows);
  void add_noise(const CastContext& context);
  void develop(const CastContext& context);
  render::PixelGrid grid_in(const mjModel* model) const;
  void check_grid(const render::PixelGrid& grid) const;
  bool is_due(const World& world, std::int64_t& image) const;
  render::ImageTargets targets(int world, int thread);
  void derive(int world, const render::ImageTargets& image, int first, int last);
  // Renders rows of tiles [first, last) of an image, and computes the fields that follow from it.
  // slot: of the builder that has the view.
  void render_rows(int slot, int world, int first, int last, int thread);
  // Renders rows of tiles [first, last) of the fixed geoms of a view.
  void make_fixed(const render::View& view, render::FixedTile* tiles, int first, int last,
                  int thread);
  void settle_common_layer(const CastContext& context, int world, int tile_rows);
  // Tiles of the world's own layer that must be rendered first; null: none.
  render::FixedTile* settle_layer(int world, const render::View& view);
  const render::View& build_view(const CastContext& context, int world,
                                 render::ViewBuilder& builder, int thread) const;
  // The world's tiles that may have changed since its last image; null: all tiles are rendered.
  render::ChangedTiles* changed_tiles(int world) {
    const bool kept = !changed_tiles_.empty() && (!motion_ || instant_ >= 0);
    return kept ? &changed_tiles_[world] : nullptr;
  }

  CameraSensorCfg cfg_;
  const mjModel* model_ = nullptr;
  int camera_ = -1;
  double near_ = 0, far_ = 0;  // m, clipping planes; far 0: none
  std::vector<PerWorld> worlds_;
  std::vector<float> distorted_rays_;
  std::vector<int> due_, exposed_;
  std::vector<std::vector<float>> clean_;  // by thread: true depth of one image; only with noise
  std::shared_ptr<const render::SurfaceAssets> assets_;
  std::unique_ptr<render::GlRenderer> gl_;  // only with renderer "opengl"
  std::unique_ptr<Workspace> workspace_;
  std::vector<render::ChangedTiles> changed_tiles_;    // by world; empty if the camera moves
  std::unique_ptr<render::FixedLayers> fixed_layers_;  // null: not useful, or the camera moves
  std::unique_ptr<OpticalFlow> optical_flow_;          // null: not requested
  std::unique_ptr<PixelOwners> owners_;                // null: not requested
  std::unique_ptr<CameraResponse> response_;           // null: the kernels make the colours
  std::unique_ptr<CameraMotion> motion_;               // null: nothing moves during an exposure
  int instant_ = -1;  // of the exposure that is rendered; -1: the present
  Field *rgb_ = nullptr, *hdr_ = nullptr, *depth_ = nullptr, *segmentation_ = nullptr,
        *bodies_ = nullptr, *entities_ = nullptr, *normals_ = nullptr, *points_ = nullptr,
        *flow_ = nullptr;
  Field *intrinsics_ = nullptr, *pose_ = nullptr;
};

}  // namespace mjsense::sensors
