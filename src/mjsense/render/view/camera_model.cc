// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/camera_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"

namespace mjsense::render {
namespace {

PixelGrid grid_from_window(int width, int height, double left, double right, double top,
                           double bottom) {
  PixelGrid grid;
  grid.width = width;
  grid.height = height;
  grid.left = static_cast<float>(left);
  grid.top = static_cast<float>(top);
  grid.dx = static_cast<float>((right - left) / width);
  grid.dy = static_cast<float>((bottom - top) / height);
  return grid;
}

struct Point {
  double x, y;
};

Point brown_conrady(Point p, std::span<const double> k) {
  const double r2 = p.x * p.x + p.y * p.y;
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  return {p.x * radial + 2 * k[2] * p.x * p.y + k[3] * (r2 + 2 * p.x * p.x),
          p.y * radial + k[2] * (r2 + 2 * p.y * p.y) + 2 * k[3] * p.x * p.y};
}

// Newton's method with numeric derivatives. Returns false if it does not converge.
bool undo_brown_conrady(Point target, std::span<const double> k, Point& out) {
  Point p = target;
  for (int i = 0; i < 50; ++i) {
    const Point f = brown_conrady(p, k);
    const double ex = target.x - f.x, ey = target.y - f.y;
    if (std::hypot(ex, ey) < 1e-12) {
      out = p;
      return true;
    }
    constexpr double h = 1e-6;
    const Point fx = brown_conrady({p.x + h, p.y}, k), fy = brown_conrady({p.x, p.y + h}, k);
    const double a = (fx.x - f.x) / h, b = (fy.x - f.x) / h, c = (fx.y - f.y) / h,
                 d = (fy.y - f.y) / h;
    const double det = a * d - b * c;
    // The distortion folds over here: no direction has this image point.
    if (!(det > 1e-9)) return false;
    p.x += (d * ex - b * ey) / det;
    p.y += (a * ey - c * ex) / det;
  }
  out = p;
  const Point f = brown_conrady(p, k);
  return std::hypot(target.x - f.x, target.y - f.y) < 1e-9;
}

// Maximum angle of a fisheye from its axis.
constexpr double kWidest = 89.0 * std::numbers::pi / 180;

double fisheye(double theta, std::span<const double> k) {
  const double t2 = theta * theta;
  return theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
}

// Returns the angle that the lens images at radius `r`, or a negative number if there is none below
// 89 degrees.
double undo_fisheye(double r, std::span<const double> k) {
  double low = 0, high = kWidest;
  if (fisheye(high, k) < r) return -1;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (fisheye(middle, k) < r ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

// Throws ValueError: the lens images no direction at pixel (x, y).
[[noreturn]] void throw_out_of_reach(const PixelGrid& grid, Lens lens, std::span<const double> k,
                                     const char* context, int x, int y) {
  if (lens == Lens::kBrownConrady)
    throw ValueError(fmt::format(
        "{}: the distortion has no inverse at pixel ({}, {}): with these coefficients the image "
        "folds over before it; use a longer focal length (fx {:.4g} now) or smaller coefficients",
        context, x, y, 1 / grid.dx));
  const double corner =
      std::max(std::hypot(grid.left, grid.top),
               std::hypot(grid.left + grid.dx * grid.width, grid.top + grid.dy * grid.height));
  const double reach = fisheye(kWidest, k);
  if (!(reach > 0))
    throw ValueError(fmt::format(
        "{}: the distortion has no inverse at pixel ({}, {}): these coefficients put 89 degrees at "
        "radius {:.4g}",
        context, x, y, reach));
  throw ValueError(
      fmt::format("{}: the distortion has no inverse at pixel ({}, {}): the direction would be "
                  "more than 89 degrees from the optical axis; use a longer focal length (fx "
                  "{:.4g} now, {:.4g} or more)",
                  context, x, y, 1 / grid.dx, std::ceil(corner / (grid.dx * reach))));
}

}  // namespace

PixelGrid grid_from_fovy(int width, int height, double fovy_deg, bool orthographic) {
  const double top = orthographic ? 0.5 * fovy_deg : std::tan(fovy_deg * std::numbers::pi / 360);
  const double right = top * width / height;
  PixelGrid grid = grid_from_window(width, height, -right, right, top, -top);
  grid.orthographic = orthographic;
  return grid;
}

PixelGrid grid_from_sensor(int width, int height, const float focal_principal[4],
                           const float sensor_size[2]) {
  double sw = sensor_size[0], sh = sensor_size[1];
  const double aspect = static_cast<double>(width) / height;
  if (aspect > sw / sh) {
    sh = sw / aspect;
  } else {
    sw = sh * aspect;
  }
  const double fx = focal_principal[0], fy = focal_principal[1], cx = focal_principal[2],
               cy = focal_principal[3];
  return grid_from_window(width, height, -(sw / 2 - cx) / fx, (sw / 2 + cx) / fx,
                          (sh / 2 - cy) / fy, -(sh / 2 + cy) / fy);
}

PixelGrid grid_from_intrinsics(int width, int height, double fx, double fy, double cx, double cy) {
  return grid_from_window(width, height, -cx / fx, (width - cx) / fx, cy / fy, -(height - cy) / fy);
}

PixelGrid grid_of_camera(const mjModel* model, int camera, int width, int height) {
  const float* size = model->cam_sensorsize + 2 * camera;
  const bool orthographic = model->cam_projection[camera] == mjPROJ_ORTHOGRAPHIC;
  if (!orthographic && size[1] != 0)
    return grid_from_sensor(width, height, model->cam_intrinsic + 4 * camera, size);
  return grid_from_fovy(width, height, model->cam_fovy[camera], orthographic);
}

std::array<float, 9> intrinsic_matrix(const PixelGrid& grid) {
  return {1 / grid.dx, 0, -grid.left / grid.dx, 0, -1 / grid.dy, -grid.top / grid.dy, 0, 0, 1};
}

std::array<double, 2> through_lens(Lens lens, std::span<const double> coefficients, double x,
                                   double y) {
  if (lens == Lens::kBrownConrady) {
    const Point bent = brown_conrady({x, y}, coefficients);
    return {bent.x, bent.y};
  }
  const double r = std::hypot(x, y);
  const double scale = r > 1e-12 ? fisheye(std::atan(r), coefficients) / r : 1;
  return {scale * x, scale * y};
}

std::vector<float> distorted_rays(const PixelGrid& grid, Lens lens,
                                  std::span<const double> coefficients, const char* context) {
  std::vector<float> rays(static_cast<std::size_t>(grid.width) * grid.height * 2);
  for (int y = 0; y < grid.height; ++y) {
    for (int x = 0; x < grid.width; ++x) {
      const Point seen{grid.left + grid.dx * (x + 0.5), -(grid.top + grid.dy * (y + 0.5))};
      Point straight{0, 0};
      bool found = true;
      if (lens == Lens::kBrownConrady) {
        found = undo_brown_conrady(seen, coefficients, straight);
      } else {
        const double r = std::hypot(seen.x, seen.y);
        const double theta = undo_fisheye(r, coefficients);
        found = theta >= 0;
        const double scale = r > 1e-12 ? std::tan(theta) / r : 1;
        straight = {seen.x * scale, seen.y * scale};
      }
      if (!found) throw_out_of_reach(grid, lens, coefficients, context, x, y);
      float* out = rays.data() + 2 * (static_cast<std::size_t>(y) * grid.width + x);
      out[0] = static_cast<float>(straight.x);
      out[1] = static_cast<float>(-straight.y);
    }
  }
  return rays;
}

}  // namespace mjsense::render
