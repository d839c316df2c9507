// SPDX-License-Identifier: Apache-2.0
// Debug drawing of a camera: its frustum and its axes, at the pose that they had when the image was
// taken.

#include <cmath>

#include "mjsense/core/debug_shapes.h"
#include "mjsense/sensors/camera/camera_sensor.h"

namespace mjsense::sensors {
namespace {

// Number of line segments for a side of the image if a lens bends it.
constexpr int kBentParts = 8;

// A camera's rays in the world frame.
class Optics {
 public:
  Optics(const render::PixelGrid& grid, std::span<const float> pose) : grid_(grid), pose_(pose) {}

  Vec3 origin() const { return {pose_[3], pose_[7], pose_[11]}; }
  // The point at `depth` that is visible at image point (u, v) in 0..1, v down.
  Vec3 point(double u, double v, double depth) const {
    double x = grid_.left + u * grid_.width * grid_.dx;
    double y = grid_.top + v * grid_.height * grid_.dy;
    if (grid_.orthographic) return to_world({x, y, -depth});
    if (grid_.distorted_rays) {
      const long column = std::lround(u * (grid_.width - 1)),
                 row = std::lround(v * (grid_.height - 1));
      const float* bent = grid_.distorted_rays + 2 * (row * grid_.width + column);
      x = bent[0];
      y = bent[1];
      depth /= std::sqrt(x * x + y * y + 1);
    }
    return to_world({depth * x, depth * y, -depth});
  }

 private:
  Vec3 to_world(Vec3 p) const {
    const auto row = [&](int i) {
      return dot({pose_[4 * i], pose_[4 * i + 1], pose_[4 * i + 2]}, p);
    };
    return origin() + Vec3{row(0), row(1), row(2)};
  }
  const render::PixelGrid& grid_;
  std::span<const float> pose_;  // [4, 4]
};

}  // namespace

void CameraSensor::draw(const World& world, DebugShapes& shapes) {
  const CameraVizCfg& viz = cfg_.viz;
  const render::PixelGrid& grid = worlds_[world.id].grid;
  const std::span<const float> pose = pose_->data.row<float>(world.id);
  const Optics optics(grid, pose);
  if (viz.show_frame) {
    const double mat[9] = {pose[0], pose[1], pose[2], pose[4], pose[5],
                           pose[6], pose[8], pose[9], pose[10]};
    shapes.add_frame(optics.origin(), mat, viz.axis_length * shapes.meansize(),
                     0.2 * shapes.meansize(), name());
  }
  if (!viz.show_frustum) return;
  const double far = viz.frustum_depth > 0 ? viz.frustum_depth
                     : far_ > 0            ? far_
                                           : 10 * shapes.meansize();
  constexpr double kCorners[5][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
  const auto line = [&](Vec3 from, Vec3 to) {
    shapes.add_line(from, to, viz.line_width, viz.frustum_color, name() + "_frustum");
  };
  const auto rim = [&](double depth) {
    const int parts = grid.distorted_rays ? kBentParts : 1;
    for (int side = 0; side < 4; ++side) {
      const double *a = kCorners[side], *b = kCorners[side + 1];
      const auto at = [&](int k) {
        const double t = static_cast<double>(k) / parts;
        return optics.point(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), depth);
      };
      for (int k = 0; k < parts; ++k) line(at(k), at(k + 1));
    }
  };
  rim(far);
  if (near_ > 0 || grid.orthographic) rim(near_);
  for (int corner = 0; corner < 4; ++corner) {
    const auto [u, v] = kCorners[corner];
    line(optics.point(u, v, near_), optics.point(u, v, far));
  }
}

}  // namespace mjsense::sensors
