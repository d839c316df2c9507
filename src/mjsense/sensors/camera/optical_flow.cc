// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/optical_flow.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "mjsense/core/model_geometry.h"
#include "mjsense/sensors/camera/pixel_owners.h"

namespace mjsense::sensors {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

bool equal(const Pose& a, const Pose& b) { return std::memcmp(&a, &b, sizeof a) == 0; }

bool same_rays(const render::PixelGrid& a, const render::PixelGrid& b) {
  return a.left == b.left && a.top == b.top && a.dx == b.dx && a.dy == b.dy &&
         a.orthographic == b.orthographic;
}

}  // namespace

OpticalFlow::OpticalFlow(const mjModel* model, int camera, const std::optional<LensModel>& lens,
                         bool clocked, const render::PixelGrid& grid, int num_worlds, int threads)
    : model_(model), camera_(camera), lens_(lens), clocked_(clocked) {
  const auto num_bodies = static_cast<std::size_t>(model->nbody);
  const Moment empty{{}, std::vector<Pose>(num_bodies), grid};
  worlds_.assign(num_worlds, {empty, empty, std::vector<Move>(num_bodies)});
  scratch_.resize(threads);
  const auto pixels = static_cast<std::size_t>(grid.width) * grid.height;
  for (Scratch& s : scratch_) {
    s.depth.resize(pixels);
    s.segmentation.resize(2 * pixels);
  }
  for (std::size_t i = 0; grid.distorted_rays && i < pixels; ++i) {
    const double x = grid.distorted_rays[2 * i], y = grid.distorted_rays[2 * i + 1];
    reach2_ = std::max(reach2_, x * x + y * y);
  }
}

void OpticalFlow::take(const World& world, const render::PixelGrid& grid) {
  PerWorld& w = worlds_[world.id];
  const bool first = !w.any || (world.first && clocked_);
  const bool again = world.substep == w.substep && !world.first;
  if (!again) std::swap(w.now, w.before);
  const mjData* d = world.data;
  w.now.camera = camera_pose(d, camera_);
  for (std::size_t b = 0; b < w.now.bodies.size(); ++b) w.now.bodies[b] = body_pose(d, b);
  w.now.grid = grid;
  if (first) w.before = w.now;
  w.any = true;
  w.substep = world.substep;

  const Pose to_before = inverse(w.before.camera);
  const bool same_camera = equal(w.before.camera, w.now.camera) && same_rays(w.before.grid, grid);
  for (std::size_t b = 0; b < w.moves.size(); ++b) {
    Move& move = w.moves[b];
    const Pose &was = w.before.bodies[b], &is = w.now.bodies[b];
    move.still = same_camera && equal(was, is);
    if (move.still) continue;
    const Pose x = to_before * was * inverse(is) * w.now.camera;
    const double q[4] = {x.q.w, x.q.x, x.q.y, x.q.z};
    mju_quat2Mat(move.r, q);
    write_vec(x.p, move.t);
  }
}

void OpticalFlow::complete(render::ImageTargets& targets, int thread) {
  if (!targets.depth) targets.depth = scratch_[thread].depth.data();
  if (!targets.segmentation) targets.segmentation = scratch_[thread].segmentation.data();
}

// Pixel coordinates of p (camera frame). Returns false if the image has no such point.
bool OpticalFlow::project(const render::PixelGrid& grid, const double p[3], double uv[2]) const {
  double x = p[0], y = p[1];
  if (!grid.orthographic) {
    if (!(p[2] < 0)) return false;
    x /= -p[2];
    y /= -p[2];
    if (lens_) {
      if (x * x + y * y > reach2_ * (1 + 1e-6)) return false;
      const auto [right, down] = render::through_lens(lens_->lens, lens_->coefficients, x, -y);
      x = right;
      y = -down;
    }
  }
  uv[0] = (x - grid.left) / grid.dx;
  uv[1] = (y - grid.top) / grid.dy;
  return true;
}

// Pixels [begin, end) of one row that show one body. This is the general computation of follow()
// for a pinhole, where everything is linear in depth and in x.
void OpticalFlow::follow_pinhole(const PerWorld& w, const Move& move, int y, int begin, int end,
                                 const float* depth, float* flow) const {
  const render::PixelGrid &now = w.now.grid, &before = w.before.grid;
  // Rows of K R and K t: image point times depth, then depth.
  double r[3][3], t[3];
  const double* last = move.r + 6;
  for (int k = 0; k < 2; ++k) {
    const double offset = k == 0 ? before.left : before.top, step = k == 0 ? before.dx : before.dy;
    for (int j = 0; j < 3; ++j) r[k][j] = (move.r[3 * k + j] + offset * last[j]) / step;
    t[k] = (move.t[k] + offset * move.t[2]) / step;
  }
  for (int j = 0; j < 3; ++j) r[2][j] = -last[j];
  t[2] = -move.t[2];
  const double ray_y = now.top + now.dy * (y + 0.5);
  double at_0[3], by_x[3];  // r (x, y, -1) of the pixel's ray
  for (int k = 0; k < 3; ++k) {
    at_0[k] = r[k][0] * (now.left + now.dx * 0.5) + r[k][1] * ray_y - r[k][2];
    by_x[k] = r[k][0] * now.dx;
  }
  for (int x = begin; x < end; ++x) {
    const double d = depth[x];
    const double z = d * (at_0[2] + by_x[2] * x) + t[2];
    const double inverse = z > 0 ? 1 / z : std::numeric_limits<double>::quiet_NaN();
    flow[2 * x] = static_cast<float>(inverse * (d * (at_0[0] + by_x[0] * x) + t[0]) - (x + 0.5));
    flow[2 * x + 1] =
        static_cast<float>(inverse * (d * (at_0[1] + by_x[1] * x) + t[1]) - (y + 0.5));
  }
}

void OpticalFlow::follow(const PerWorld& w, const Move& move, int y, int begin, int end,
                         const float* depth, bool ray_depth, float* flow) const {
  const render::PixelGrid& now = w.now.grid;
  for (int x = begin; x < end; ++x) {
    double ray[2] = {now.left + now.dx * (x + 0.5), now.top + now.dy * (y + 0.5)};
    if (now.distorted_rays)
      std::copy_n(now.distorted_rays + 2 * (static_cast<std::size_t>(y) * now.width + x), 2, ray);
    double d = depth[x];
    if (ray_depth && !now.orthographic) d /= std::sqrt(1 + ray[0] * ray[0] + ray[1] * ray[1]);
    const double spread = now.orthographic ? 1 : d;
    const double p[3] = {spread * ray[0], spread * ray[1], -d};
    double was[3], uv[2];
    for (int k = 0; k < 3; ++k) {
      const double* r = move.r + 3 * k;
      was[k] = r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + move.t[k];
    }
    const bool seen = project(w.before.grid, was, uv);
    flow[2 * x] = seen ? static_cast<float>(uv[0] - (x + 0.5)) : kNan;
    flow[2 * x + 1] = seen ? static_cast<float>(uv[1] - (y + 0.5)) : kNan;
  }
}

void OpticalFlow::write(int world, const render::ImageTargets& image, int first, int last,
                        float* flow) const {
  const PerWorld& w = worlds_[world];
  const render::PixelGrid& grid = w.now.grid;
  const bool pinhole = !grid.distorted_rays && !image.depth_along_ray && !grid.orthographic;
  for (int y = first; y < last; ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * grid.width;
    const std::int32_t* ids = image.segmentation + 2 * row;
    float* out = flow + 2 * row;
    for (int x = 0, end; x < grid.width; x = end) {
      const std::int32_t *id = ids + 2 * x, *next = id;
      for (end = x; end < grid.width && next[0] == id[0] && next[1] == id[1]; ++end) next += 2;
      const int body = body_of(model_, id[1], id[0]);
      const Move* move = body >= 0 ? &w.moves[body] : nullptr;
      if (!move || move->still) {
        std::fill(out + 2 * x, out + 2 * end, move ? 0.0f : kNan);
      } else if (pinhole) {
        follow_pinhole(w, *move, y, x, end, image.depth + row, out);
      } else {
        follow(w, *move, y, x, end, image.depth + row, image.depth_along_ray, out);
      }
    }
  }
}

}  // namespace mjsense::sensors
