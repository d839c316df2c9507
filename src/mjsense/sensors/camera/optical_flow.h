// SPDX-License-Identifier: Apache-2.0
#pragma once
// Optical flow from poses: where the surface point that a pixel sees was in the camera's previous
// image. It is exact for rigid bodies, moving or not; the point need not have been visible then.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"
#include "mjsense/render/view/camera_model.h"
#include "mjsense/render/view/view.h"

namespace mjsense::sensors {

// The lens of a PixelGrid with bent rays.
struct LensModel {
  render::Lens lens;
  std::vector<double> coefficients;
};

class OpticalFlow {
 public:
  // `clocked`: images are taken at times of their own (update_period), not when they are read.
  OpticalFlow(const mjModel* model, int camera, const std::optional<LensModel>& lens, bool clocked,
              const render::PixelGrid& grid, int num_worlds, int threads);

  // The next image of this world is the first one of its episode; its flow is 0.
  void reset(int world) { worlds_[world].any = false; }
  // Call when an image of the world's current state is taken along the rays of `grid`. The image
  // follows the previous one, or replaces it if it has the same time (after forward()). Before the
  // first step after a reset, when poses are written by hand, every image follows the previous one;
  // for a clocked camera, every one of these is a first image. Does not allocate.
  void take(const World& world, const render::PixelGrid& grid);

  // Adds buffers of this thread for what write() needs and `targets` lacks.
  void complete(render::ImageTargets& targets, int thread);
  // Writes pixel rows [first, last) of flow [H, W, 2]: (u, v) of the point in the previous image
  // minus (u, v) of the pixel, in pixels, u right, v down. NaN where no rigid body is seen, and
  // where the point was behind the camera or outside the lens's field of view.
  void write(int world, const render::ImageTargets& image, int first, int last, float* flow) const;

 private:
  // All poses when an image was taken.
  struct Moment {
    Pose camera;               // X_WC
    std::vector<Pose> bodies;  // X_WB [nbody]
    render::PixelGrid grid;
  };
  // Motion of a body's points: p in the camera frame of the previous image = r p in that of the
  // current one + t.
  struct Move {
    double r[9], t[3];
    bool still;  // nothing has moved: flow is exactly 0
  };
  struct PerWorld {
    Moment now, before;
    std::vector<Move> moves;  // [nbody]
    std::int64_t substep = 0;
    bool any = false;  // an image was taken since the reset
  };
  struct Scratch {
    std::vector<float> depth;
    std::vector<std::int32_t> segmentation;
  };
  bool project(const render::PixelGrid& grid, const double p[3], double uv[2]) const;
  // Pixels [begin, end) of row y, which show one body. `depth` and `flow` are those of the row.
  void follow(const PerWorld& w, const Move& move, int y, int begin, int end, const float* depth,
              bool ray_depth, float* flow) const;
  void follow_pinhole(const PerWorld& w, const Move& move, int y, int begin, int end,
                      const float* depth, float* flow) const;

  const mjModel* model_;
  int camera_;
  std::optional<LensModel> lens_;
  bool clocked_;
  double reach2_ = 0;  // square of tan of the lens's maximum angle
  std::vector<PerWorld> worlds_;
  std::vector<Scratch> scratch_;  // by thread
};

}  // namespace mjsense::sensors
