// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/path_lights.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

using std::numbers::pi;

Vec3 minus(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

Rgb64 times(const float* rgb, double scale) {
  return {rgb[0] * scale, rgb[1] * scale, rgb[2] * scale};
}

// Share of a sample of density `density` if the same direction can also be drawn with `other`.
double share(double density, double other) {
  return density == 0 ? 1 : density / (density + other);
}

// Solid angle and direction cosines of a ball of this radius at a distance.
struct Cone {
  double square_sine, least_cosine, solid_angle;

  Cone(double radius, double distance)
      : square_sine(radius * radius / (distance * distance)),
        least_cosine(std::sqrt(1 - square_sine)),
        solid_angle(2 * pi * square_sine / (1 + least_cosine)) {}
};

// Distance to the ball along a ray from its outside; infinity if the ray misses it.
double reach_ball(const Vec3& to_center, const Vec3& direction, double radius) {
  const double along = dot(to_center, direction);
  const double half2 = radius * radius - (dot(to_center, to_center) - along * along);
  return half2 < 0 || along < 0 ? INFINITY : along - std::sqrt(half2);
}

}  // namespace

void PathLights::build(const View& view) {
  view_ = &view;
  emitters_.clear();
  emitter_of_.assign(view.num_geoms, -1);
  for (int i = 0; i < view.num_geoms; ++i) add_emitter(i);
}

void PathLights::add_emitter(int index) {
  const ViewGeom& g = view_->geoms[index];
  const Surface& s = g.surface;
  const double light =
      luminance(times(s.rgba, s.emission * static_cast<double>(view_->physical.unit)));
  if (!(light > 0) || !g.casts_shadows) return;
  // Estimated without textures.
  Emitter out{index, vec3(g.center), 0, 0};
  const double x = g.size[0], y = g.size[1], z = g.size[2];
  switch (g.type) {
    case mjGEOM_PLANE:
      if (x > 0 && y > 0) out.area = 4 * x * y;
      out.center = vec3(g.pos);
      break;
    case mjGEOM_BOX:
      out.area = 8 * (x * y + y * z + z * x);
      break;
    case mjGEOM_SPHERE:
      out.area = 4 * pi * x * x;
      break;
    default:
      break;
  }
  if (!(out.area > 0)) return;
  out.power = light * out.area;
  emitter_of_[index] = static_cast<int>(emitters_.size());
  emitters_.push_back(out);
}

PathLights::Arriving PathLights::arriving(const ViewLight& light, const Vec3& p) const {
  if (light.kind == LightKind::kDirectional) {
    const Vec3 to = unit({-light.dir[0], -light.dir[1], -light.dir[2]});
    return {to, INFINITY, 1};
  }
  Vec3 to = minus(vec3(light.pos), p);
  const double distance = std::sqrt(std::max(dot(to, to), 1e-20));
  for (double& x : to) x /= distance;
  const float* a = light.attenuation;
  double scale = 1 / std::max(a[0] + distance * (a[1] + distance * a[2]), 1e-6);
  if (light.range > 0) {
    const double square = distance / light.range * (distance / light.range);
    scale *= std::max(1 - square * square, 0.0);
  }
  if (light.kind == LightKind::kSpot) {
    const double cosine = -dot(to, vec3(light.dir));
    if (cosine < light.cos_cutoff) return {to, distance, 0};
    if (light.exponent > 0) scale *= std::pow(std::max(cosine, 0.0), light.exponent);
  }
  return {to, distance, scale};
}

// From inside of it or very near, it is a point.
bool PathLights::is_ball(const ViewLight& light, double distance) const {
  return light.kind != LightKind::kDirectional && light.radius > 0 &&
         distance > 1.001 * light.radius;
}

double PathLights::environment_estimate() const {
  const float* scale = view_->physical.radiance_scale;
  return pi * environment_->mean() * luminance({scale[0], scale[1], scale[2]});
}

// Luminance of the light on a surface that faces it. Lights of the model, then emissive geoms.
double PathLights::estimate(std::size_t i, const Vec3& p) const {
  if (i < static_cast<std::size_t>(view_->num_lights)) {
    const ViewLight& light = view_->lights[i];
    return pi * luminance(times(light.diffuse, arriving(light, p).scale));
  }
  const Emitter& emitter = emitters_[i - view_->num_lights];
  const Vec3 offset = minus(emitter.center, p);
  return emitter.power / 4 / (dot(offset, offset) + emitter.area / (8 * pi));
}

double PathLights::total(const Vec3& p) const {
  double sum = environment_estimate();
  for (std::size_t i = 0; i < view_->num_lights + emitters_.size(); ++i) sum += estimate(i, p);
  return sum;
}

void PathLights::sample_light(const ViewLight& light, const Vec3& p, PathRandom& random,
                              LightSample& out) const {
  const Arriving at = arriving(light, p);
  out.blocked = view_->shadows && light.casts_shadows;
  out.direction = at.to;
  out.distance = at.distance;
  out.density = 0;
  out.radiance = times(light.diffuse, pi * at.scale);
  if (light.kind == LightKind::kDirectional) {
    // MuJoCo's directional lights have a position: geoms behind it cast no shadow.
    out.distance = std::max(0.0, dot(minus(vec3(light.pos), p), at.to));
    return;
  }
  if (!is_ball(light, at.distance)) return;
  const Cone cone(light.radius, at.distance);
  const auto [u, v] = random.square();
  const double cosine = 1 - u * cone.square_sine / (1 + cone.least_cosine);
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const double angle = 2 * pi * v;
  const auto [x, y] = tangents(at.to);
  for (int k = 0; k < 3; ++k)
    out.direction[k] = cosine * at.to[k] + sine * (std::cos(angle) * x[k] + std::sin(angle) * y[k]);
  Vec3 to_center;
  for (int k = 0; k < 3; ++k) to_center[k] = at.distance * at.to[k];
  const double reach = reach_ball(to_center, out.direction, light.radius);
  out.distance = std::isinf(reach) ? at.distance * cone.least_cosine : reach;
  out.density = 1 / cone.solid_angle;
  for (double& c : out.radiance) c /= pi * cone.square_sine;
}

bool PathLights::sample_emitter(const Emitter& emitter, const Vec3& p, PathRandom& random,
                                LightSample& out) const {
  const ViewGeom& g = view_->geoms[emitter.geom];
  const auto [u, v] = random.square();
  const double s = 2 * u - 1, t = 2 * v - 1;
  Vec3 at{}, n{0, 0, 1};  // geom frame
  const double x = g.size[0], y = g.size[1], z = g.size[2];
  switch (g.type) {
    case mjGEOM_PLANE:
      at = {s * x, t * y, 0};
      break;
    case mjGEOM_SPHERE: {
      const double level = std::sqrt(std::max(0.0, 1 - s * s)), angle = 2 * pi * v;
      n = {level * std::cos(angle), level * std::sin(angle), s};
      at = {x * n[0], x * n[1], x * n[2]};
      break;
    }
    default: {
      const auto [side, end] = random.square();
      double face = side * (x * y + y * z + z * x);
      const double sign = end < 0.5 ? -1 : 1;
      if (face < x * y) {
        at = {s * x, t * y, sign * z};
        n = {0, 0, sign};
      } else if (face < x * y + y * z) {
        at = {sign * x, s * y, t * z};
        n = {sign, 0, 0};
      } else {
        at = {s * x, sign * y, t * z};
        n = {0, sign, 0};
      }
    }
  }
  Vec3 offset, normal;
  for (int k = 0; k < 3; ++k) {
    const float* r = g.rot + 3 * k;
    offset[k] = g.pos[k] + r[0] * at[0] + r[1] * at[1] + r[2] * at[2] - p[k];
    normal[k] = r[0] * n[0] + r[1] * n[1] + r[2] * n[2];
  }
  out.distance = std::sqrt(dot(offset, offset));
  for (int k = 0; k < 3; ++k) out.direction[k] = offset[k] / out.distance;
  const double cosine = -dot(out.direction, normal);
  if (!(cosine > 1e-6)) return false;
  out.geom = emitter.geom;
  out.blocked = true;
  out.density = out.distance * out.distance / (emitter.area * cosine);
  return true;
}

Vec3 PathLights::to_environment(const Vec3& d) const {
  const float* r = view_->physical.r_ec;
  Vec3 out;
  for (int k = 0; k < 3; ++k) out[k] = r[3 * k] * d[0] + r[3 * k + 1] * d[1] + r[3 * k + 2] * d[2];
  return unit(out);
}

bool PathLights::sample(const Vec3& p, double total, PathRandom& random, LightSample& out) const {
  if (!(total > 0)) return false;
  out = {};
  double left = random.uniform() * total;
  const std::size_t lights = view_->num_lights;
  for (std::size_t i = 0; i < lights + emitters_.size(); ++i) {
    const double part = estimate(i, p);
    left -= part;
    if (left >= 0) continue;
    out.choice = part / total;
    if (i >= lights) return sample_emitter(emitters_[i - lights], p, random, out);
    sample_light(view_->lights[i], p, random, out);
    return true;
  }
  const double part = environment_estimate();
  if (!(part > 0)) return false;
  out.choice = part / total;
  const double choice = random.uniform();
  const auto [u, v] = random.square();
  const auto [d, density, radiance] = environment_->sample(choice, u, v);
  const float* r = view_->physical.r_ec;
  for (int k = 0; k < 3; ++k) out.direction[k] = r[k] * d[0] + r[3 + k] * d[1] + r[6 + k] * d[2];
  out.direction = unit(out.direction);
  out.distance = INFINITY;
  out.blocked = true;
  out.density = density;
  for (int c = 0; c < 3; ++c) out.radiance[c] = radiance[c] * view_->physical.radiance_scale[c];
  return out.density > 0;
}

Rgb64 PathLights::surroundings(const Vec3& direction, double density, double total) const {
  const double estimate = environment_estimate();
  if (!(estimate > 0)) return {};
  const Vec3 d = to_environment(direction);
  Rgb64 out = environment_->radiance(d);
  const double drawn = density == 0 ? 0 : environment_->density(d) * estimate / total;
  for (int c = 0; c < 3; ++c) out[c] *= view_->physical.radiance_scale[c] * share(density, drawn);
  return out;
}

Rgb64 PathLights::balls(const Vec3& from, const Vec3& o, const Vec3& direction, double end,
                        bool first, double density, double total) const {
  Rgb64 out{};
  for (int i = 0; i < view_->num_lights; ++i) {
    const ViewLight& light = view_->lights[i];
    const double bright = pi * luminance(times(light.diffuse, 1));
    if (!(light.radius > 0) || !(bright > 0) || light.kind == LightKind::kDirectional) continue;
    const bool blocked = view_->shadows && light.casts_shadows;
    if (!blocked && !first) continue;
    const Arriving at = arriving(light, from);
    if (!(at.scale > 0) || !is_ball(light, at.distance)) continue;
    const double reach = reach_ball(minus(vec3(light.pos), o), direction, light.radius);
    if (std::isinf(reach) || reach < 0 || (blocked && reach > end)) continue;
    const Cone cone(light.radius, at.distance);
    const double choice = bright * at.scale / total;
    const double weight = share(density, choice / cone.solid_angle) * at.scale / cone.square_sine;
    for (int c = 0; c < 3; ++c) out[c] += weight * light.diffuse[c];
  }
  return out;
}

double PathLights::emitter_weight(int geom, const Vec3& from, const Vec3& at, double cosine,
                                  double density, double total) const {
  const int emitter = emitter_of_[geom];
  if (density == 0 || emitter < 0) return 1;
  const Vec3 offset = minus(at, from);
  const double choice = estimate(view_->num_lights + emitter, from) / total;
  return share(density,
               choice * dot(offset, offset) / (emitters_[emitter].area * std::max(cosine, 1e-6)));
}

}  // namespace mjsense::render
