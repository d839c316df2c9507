// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/raycast/pattern.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::sensors {
namespace {

constexpr double kMaxRays = 1 << 24;

using Direction = std::array<double, 3>;

Direction unit(const Direction& d, std::string_view context) {
  const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  if (!std::isfinite(length) || length < 1e-12)
    throw ValueError(fmt::format("{}: ray direction ({}, {}, {}) must have a finite length above 0",
                                 context, d[0], d[1], d[2]));
  return {d[0] / length, d[1] / length, d[2] / length};
}

std::vector<double> grid_axis(double size, double resolution) {
  const int count = static_cast<int>(std::ceil((size + 0.5 * resolution) / resolution));
  std::vector<double> values(count);
  for (int k = 0; k < count; ++k) values[k] = -0.5 * size + k * resolution;
  return values;
}

RayPattern make(const GridPattern& g, const mjModel*, std::string_view context) {
  const Direction d = unit(g.direction, context);
  RayPattern pattern;
  for (double y : grid_axis(g.size[1], g.resolution))
    for (double x : grid_axis(g.size[0], g.resolution)) pattern.offsets.push_back({x, y, 0});
  pattern.directions.assign(pattern.offsets.size(), d);
  return pattern;
}

void check_pinhole(double width, double height, double fovy, std::string_view context) {
  if (!(width >= 1 && height >= 1))
    throw ValueError(fmt::format("{}: pinhole pattern of {} x {} rays: both must be at least 1",
                                 context, width, height));
  if (!(fovy > 0 && fovy < 180))
    throw ValueError(
        fmt::format("{}: pinhole fovy is {} degrees: must be between 0 and 180", context, fovy));
  check_ray_count(width * height, context);
}

double linspace(int i, int count) { return count > 1 ? -1.0 + 2.0 * i / (count - 1) : -1.0; }

RayPattern make(const PinholePattern& p, const mjModel* model, std::string_view context) {
  int width = p.width, height = p.height;
  double tan_v = std::tan(0.5 * p.fovy * std::numbers::pi / 180), tan_h = 0;
  double fovy = p.fovy;
  if (!p.camera.empty()) {
    if (model == nullptr)
      throw ValueError(fmt::format("{}: camera '{}' needs a model", context, p.camera));
    const int c = scene::resolve(model, mjOBJ_CAMERA, p.camera, context);
    if (model->cam_projection[c] == mjPROJ_ORTHOGRAPHIC)
      throw ValueError(
          fmt::format("{}: camera '{}' is orthographic: its rays are parallel; use a grid pattern",
                      context, p.camera));
    width = model->cam_resolution[2 * c];
    height = model->cam_resolution[2 * c + 1];
    fovy = model->cam_fovy[c];
    tan_v = std::tan(0.5 * fovy * std::numbers::pi / 180);
    const float* sensor = model->cam_sensorsize + 2 * c;
    const float* focal = model->cam_intrinsic + 4 * c;
    if (sensor[0] > 0 && sensor[1] > 0 && focal[0] > 0 && focal[1] > 0) {
      tan_h = sensor[0] / (2.0 * focal[0]);
      tan_v = sensor[1] / (2.0 * focal[1]);
      fovy = 2 * std::atan(tan_v) * 180 / std::numbers::pi;
    }
  }
  check_pinhole(width, height, fovy, context);
  if (tan_h == 0) tan_h = tan_v * width / height;
  RayPattern pattern;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      pattern.directions.push_back(
          unit({linspace(u, width) * tan_h, linspace(v, height) * tan_v, -1.0}, context));
  pattern.offsets.assign(pattern.directions.size(), {0, 0, 0});
  return pattern;
}

RayPattern make(const RingPattern& r, const mjModel*, std::string_view context) {
  const Direction d = unit(r.direction, context);
  RayPattern pattern;
  if (r.include_center) pattern.offsets.push_back({0, 0, 0});
  for (const RingPattern::Ring& ring : r.rings) {
    for (int i = 0; i < ring.num_samples; ++i) {
      const double angle = 2 * std::numbers::pi * i / ring.num_samples;
      pattern.offsets.push_back({ring.radius * std::cos(angle), ring.radius * std::sin(angle), 0});
    }
  }
  pattern.directions.assign(pattern.offsets.size(), d);
  return pattern;
}

RayPattern make(const UserPattern& u, const mjModel*, std::string_view context) {
  const std::size_t n = std::max(u.offsets.size(), u.directions.size());
  RayPattern pattern;
  for (std::size_t i = 0; i < n; ++i) {
    pattern.offsets.push_back(u.offsets[u.offsets.size() == 1 ? 0 : i]);
    pattern.directions.push_back(unit(u.directions[u.directions.size() == 1 ? 0 : i], context));
  }
  pattern.times = u.times;
  return pattern;
}

}  // namespace

void check_ray_count(double rays, std::string_view context) {
  if (rays > kMaxRays)
    throw ValueError(
        fmt::format("{}: {:.0f} rays: the maximum is {:.0f}", context, rays, kMaxRays));
}

void validate(const GridPattern& g, std::string_view context) {
  check_ray_count((g.size[0] / g.resolution + 1) * (g.size[1] / g.resolution + 1), context);
  unit(g.direction, context);
}

void validate(const PinholePattern& p, std::string_view context) {
  if (p.camera.empty()) check_pinhole(p.width, p.height, p.fovy, context);
}

void validate(const RingPattern& r, std::string_view context) {
  unit(r.direction, context);
  double rays = r.include_center;
  for (const RingPattern::Ring& ring : r.rings) rays += ring.num_samples;
  check_ray_count(rays, context);
  if (rays == 0) throw ValueError(fmt::format("{}: the pattern has no rays", context));
}

void validate(const UserPattern& u, std::string_view context) {
  const std::size_t n = std::max(u.offsets.size(), u.directions.size());
  if (n == 0) throw ValueError(fmt::format("{}: the pattern has no rays", context));
  for (std::size_t count : {u.offsets.size(), u.directions.size()})
    if (count != n && count != 1)
      throw ValueError(fmt::format(
          "{}: pattern of {} offsets and {} directions: give equal numbers, or one of either",
          context, u.offsets.size(), u.directions.size()));
  for (const Direction& d : u.directions) unit(d, context);
  if (!u.times.empty() && u.times.size() != n)
    throw ValueError(
        fmt::format("{}: pattern of {} rays and {} times", context, n, u.times.size()));
}

PinholePattern PinholePattern::from_intrinsic_matrix(const std::array<double, 9>& k, int width,
                                                     int height) {
  if (!(k[4] > 0))
    throw ValueError(
        fmt::format("pinhole pattern: fy is {} in the intrinsic matrix: must be above 0", k[4]));
  return {width, height, 2 * std::atan(height / (2 * k[4])) * (180 / std::numbers::pi), ""};
}

PinholePattern PinholePattern::from_mujoco_camera(std::string camera_name) {
  PinholePattern p;
  p.camera = std::move(camera_name);
  return p;
}

RingPattern RingPattern::single_ring(double radius, int num_samples) {
  RingPattern p;
  p.rings = {{radius, num_samples}};
  return p;
}

RayPattern make_pattern(const PatternCfg& cfg, const mjModel* model, std::string_view context) {
  return std::visit(
      [&](const auto& p) {
        check_fields(p, context);
        return make(p, model, context);
      },
      cfg);
}

}  // namespace mjsense::sensors
