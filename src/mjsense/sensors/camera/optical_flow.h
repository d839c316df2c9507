// SPDX-License-Identifier: Apache-2.0
#pragma once
// Optical flow from poses: where the surface point that a pixel sees was in the camera's previous
// image. Exact for rigid bodies, moving or not; the point is followed whether it was visible then
// or not.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/sensor.h"
#include "mjsense/render/view/camera_model.h"
#include "mjsense/render/view/view.h"

namespace mjsense {

// The lens in front of a PixelGrid with bent rays.
struct LensModel {
  Lens lens;
  std::vector<double> coefficients;
};

class OpticalFlow {
 public:
  // clocked: images are taken at times of their own (update_period), not when they are read.
  OpticalFlow(const mjModel* model, int camera, const std::optional<LensModel>& lens, bool clocked,
              const PixelGrid& grid, int num_worlds, int threads);

  // The next image of this world is the first of its episode: nothing moves in it.
  void reset(int world) { worlds_[world].any = false; }
  // An image of the world as it is now is taken along the rays of `grid`. It follows the one
  // before, or replaces that if it was taken at the same time (after forward()). As long as no step
  // was taken since the reset, when poses are written by hand, every image follows the one before
  // it; of a clocked camera, every one is a first image. No allocation.
  void take(const World& world, const PixelGrid& grid);

  // Buffers of this thread for what write() needs and `targets` lacks.
  void complete(ImageTargets& targets, int thread);
  // Pixel rows [first, last) of flow [H, W, 2]: (u, v) of the point in the previous image minus
  // (u, v) of the pixel, in pixels, u right, v down. NaN where nothing rigid is seen, and where the
  // point was behind the camera or farther out than the lens has an image.
  void write(int world, const ImageTargets& image, int first, int last, float* flow) const;

 private:
  // Where everything was when an image was taken.
  struct Moment {
    Pose camera;               // X_WC
    std::vector<Pose> bodies;  // X_WB [nbody]
    PixelGrid grid;
  };
  // p in the camera frame of the previous image = r p in that of the present one + t, for the
  // points of a body.
  struct Move {
    double r[9], t[3];
    bool still;  // nothing has moved: flow is 0 to the last bit
  };
  struct PerWorld {
    Moment now, before;
    std::vector<Move> moves;  // [nbody]
    std::int64_t substep = 0;
    bool any = false;  // image since the reset
  };
  struct Scratch {
    std::vector<float> depth;
    std::vector<std::int32_t> segmentation;
  };
  bool project(const PixelGrid& grid, const double p[3], double uv[2]) const;
  // Pixels [begin, end) of row y, which see one body. depth, flow: of the row.
  void follow(const PerWorld& w, const Move& move, int y, int begin, int end, const float* depth,
              bool ray_depth, float* flow) const;
  void follow_pinhole(const PerWorld& w, const Move& move, int y, int begin, int end,
                      const float* depth, float* flow) const;

  const mjModel* model_;
  int camera_;
  std::optional<LensModel> lens_;
  bool clocked_;
  double reach2_ = 0;  // square of tan of the angle to which the lens has an image
  std::vector<PerWorld> worlds_;
  std::vector<Scratch> scratch_;  // by thread
};

}  // namespace mjsense
