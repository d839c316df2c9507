// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/path_wave.h"

#include <algorithm>
#include <cmath>

#include "mjsense/render/path/scatter.h"

namespace mjsense::render {
namespace {

constexpr int kSurvivors = 4;  // reflections after which paths end at random

Vec3 advanced(const Vec3& o, double t, const Vec3& d) {
  return {o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]};
}

// Distance from a surface at which a ray starts, m, so that rounding does not let it hit the surface. Points
// are stored in single precision.
double clearance(const Vec3& p, double t) {
  return 2e-5 + 4e-6 * (std::abs(p[0]) + std::abs(p[1]) + std::abs(p[2]) + t);
}

PathRay ray_of(const Vec3& o, const Vec3& d, double tmax) {
  PathRay out;
  for (int k = 0; k < 3; ++k) {
    out.o[k] = static_cast<float>(o[k]);
    out.d[k] = static_cast<float>(d[k]);
  }
  out.tmax = static_cast<float>(tmax);
  return out;
}

// A frame whose z axis is n.
struct SurfaceFrame {
  Vec3 n, x, y;

  explicit SurfaceFrame(const Vec3& normal) : n(normal) {
    const auto axes = tangents(n);
    x = axes[0];
    y = axes[1];
  }
  Vec3 local(const Vec3& v) const { return {dot(v, x), dot(v, y), dot(v, n)}; }
  Vec3 world(const Vec3& v) const {
    Vec3 out;
    for (int k = 0; k < 3; ++k) out[k] = v[0] * x[k] + v[1] * y[k] + v[2] * n[k];
    return unit(out);
  }
};

// As in images of the kernels, a box is a mirror on its top only.
bool is_mirror(const View& view, const PathHit& hit) {
  const ViewGeom& g = view.geoms[hit.geom];
  if (g.id != view.mirror_id) return false;
  const double up = g.rot[2] * hit.n[0] + g.rot[5] * hit.n[1] + g.rot[8] * hit.n[2];
  return up > 0.5;
}

}  // namespace

void PathWave::start(int x0, int x1, int y0, int y1, int sample) {
  const PixelGrid& grid = scene_.view().grid;
  const double near = scene_.view().near;
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) {
      active_.push_back(static_cast<int>(paths_.size()));
      Path& path = paths_.emplace_back();
      path.random = PathRandom(static_cast<std::uint32_t>(y * grid.width + x), sample);
      const auto [right, down] = path.random.square();
      PathPixel& seen = pixels_.emplace_back();
      seen = {};
      seen.geom = -1;
      seen.t = INFINITY;
      if (grid.distorted_rays) {
        // Between the rays of neighbouring pixels, a lens is smooth.
        const auto at = [&](int column, int row) {
          return grid.distorted_rays +
                 2 * (static_cast<std::ptrdiff_t>(std::clamp(row, 0, grid.height - 1)) *
                          grid.width +
                      std::clamp(column, 0, grid.width - 1));
        };
        const float* center = at(x, y);
        float* out[] = {&seen.x, &seen.y};
        for (int k = 0; k < 2; ++k) {
          const float* left = at(x - 1, y);
          const float* other = at(x + 1, y);
          const float* above = at(x, y - 1);
          const float* below = at(x, y + 1);
          const double across = (x > 0 && x + 1 < grid.width) ? 0.5 : 1;
          const double upright = (y > 0 && y + 1 < grid.height) ? 0.5 : 1;
          *out[k] = static_cast<float>(center[k] + (right - 0.5) * across * (other[k] - left[k]) +
                                       (down - 0.5) * upright * (below[k] - above[k]));
        }
      } else {
        seen.x = static_cast<float>(grid.left + grid.dx * (x + right));
        seen.y = static_cast<float>(grid.top + grid.dy * (y + down));
      }
      if (grid.orthographic) {
        path.o = {seen.x, seen.y, -near};
        path.d = {0, 0, -1};
      } else {
        path.d = unit({seen.x, seen.y, -1});
        path.o = {near * seen.x, near * seen.y, -near};
      }
      path.from = path.o;
      path.density = path.total = 0;
      path.throughput = {1, 1, 1};
      path.radiance = {};
    }
}

// Finds what the active paths hit, and gathers the surfaces in the order of their geoms.
void PathWave::trace(PathScene::Stops stops) {
  const View& view = scene_.view();
  rays_.clear();
  for (int i : active_) {
    const Path& path = paths_[i];
    const double left = stops == PathScene::Stops::kSight && view.far > 0
                            ? (path.o[2] + view.far) / -path.d[2]
                            : INFINITY;
    rays_.push_back(ray_of(path.o, path.d, left));
  }
  hits_.resize(rays_.size());
  scene_.trace(rays_, stops, hits_);
  met_.clear();
  for (std::size_t i = 0; i < active_.size(); ++i)
    if (hits_[i].geom >= 0) met_.push_back(static_cast<std::uint64_t>(hits_[i].geom) << 32 | i);
  std::ranges::sort(met_);
  met_hits_.clear();
  points_.clear();
  for (std::uint64_t& i : met_) {
    i &= 0xffffffffu;
    const Path& path = paths_[active_[i]];
    met_hits_.push_back(hits_[i]);
    points_.push_back(advanced(path.o, hits_[i].t, path.d));
  }
  surfaces_.resize(met_.size());
  find_surfaces(view, met_hits_, points_, surfaces_);
}

// Adds what a path sees beyond all geoms or, of the model's lights, before the hit.
bool PathWave::leave(Path& path, const PathHit& hit) {
  const bool reflected = path.reflections > 0;
  if (!reflected) return hit.geom < 0;
  const double end = hit.geom < 0 ? INFINITY : hit.t;
  Rgb64 light{};
  if (path.density > 0)  // a mirror does not show them either
    light = lights_.balls(path.from, path.o, path.d, end, path.o == path.from, path.density,
                          path.total);
  if (hit.geom < 0) {
    const Rgb64 around = lights_.surroundings(path.d, path.density, path.total);
    for (int c = 0; c < 3; ++c) light[c] += around[c];
  }
  for (int c = 0; c < 3; ++c) path.radiance[c] += path.throughput[c] * light[c];
  return hit.geom < 0;
}

// Adds the light that a path finds at a surface and continues it. False: the path ends.
bool PathWave::reflect(int index, const PathHit& hit, const PathSurface& surface,
                       const Vec3& point) {
  Path& path = paths_[index];
  const View& view = scene_.view();
  Vec3 face = vec3(hit.n);
  const bool back = dot(face, path.d) > 0;
  if (back)
    for (double& x : face) x = -x;
  path.random.begin_surface(path.surfaces++);
  if (surface.alpha < 1 && (back || path.random.uniform() >= surface.alpha)) {
    // Seen through. The ray continues behind the surface.
    path.o = advanced(point, clearance(point, hit.t), path.d);
    return true;
  }
  if (path.reflections == 0) {
    PathPixel& pixel = pixels_[index];
    pixel.geom = hit.geom;
    pixel.t = static_cast<float>(-point[2]);
  }
  if (std::ranges::max(surface.glow) > 0 && !back) {
    const double weight = lights_.emitter_weight(hit.geom, path.from, point, -dot(face, path.d),
                                                 path.density, path.total);
    for (int c = 0; c < 3; ++c) path.radiance[c] += path.throughput[c] * weight * surface.glow[c];
  }
  if (path.reflections >= kSurvivors) {
    const double going = std::min(0.95, std::ranges::max(path.throughput));
    if (path.random.uniform() >= going) return false;
    for (double& c : path.throughput) c /= going;
  }
  const bool seen = path.reflections++ == 0;
  const Vec3 start = advanced(point, clearance(point, hit.t), face);
  const Vec3 to_viewer{-path.d[0], -path.d[1], -path.d[2]};
  // A mirror is one for the camera only: light that it throws onto other surfaces would be found by chance.
  if (seen && is_mirror(view, hit) && path.random.uniform() < view.physical.reflectance) {
    const double twice = 2 * dot(to_viewer, face);
    path.d = unit({twice * face[0] - to_viewer[0], twice * face[1] - to_viewer[1],
                   twice * face[2] - to_viewer[2]});
    path.o = path.from = start;
    path.density = 0;
    return true;
  }
  Vec3 normal = surface.normal;
  if (back)
    for (double& x : normal) x = -x;
  // An interpolated normal may face away from the viewer.
  if (dot(normal, to_viewer) < 1e-3) normal = face;
  const SurfaceFrame frame(normal);
  Vec3 v = frame.local(to_viewer);
  v[2] = std::max(v[2], 1e-4);
  const Scatter scatter(surface.substance, unit(v));
  path.total = lights_.total(start);
  LightSample light;
  if (lights_.sample(start, path.total, path.random, light) && dot(light.direction, face) > 0) {
    const Scatter::Value value = scatter.value(frame.local(light.direction));
    const double density = light.choice * light.density;
    double weight = 1 / light.choice;  // for a light of exactly this direction
    if (light.density > 0) weight = 1 / (density + value.density);
    Shadow shadow{index, start, light.direction, light.distance, {}, light.geom};
    bool any = false;
    for (int c = 0; c < 3; ++c) {
      shadow.light[c] = path.throughput[c] * value.reflected[c] * weight *
                        (light.geom < 0 ? light.radiance[c] : 1.0);
      any |= shadow.light[c] > 0;
    }
    if (any && light.blocked) {
      shadows_.push_back(shadow);
    } else if (any) {
      for (int c = 0; c < 3; ++c) path.radiance[c] += shadow.light[c];
    }
  }
  const double choice = path.random.uniform();
  const auto [a, b] = path.random.square();
  const Vec3 l = scatter.sample(choice, a, b);
  const Scatter::Value value = scatter.value(l);
  path.d = frame.world(l);
  if (!(value.density > 0) || dot(path.d, face) <= 0) return false;
  bool any = false;
  for (int c = 0; c < 3; ++c) {
    path.throughput[c] *= value.reflected[c] / value.density;
    any |= path.throughput[c] > 0;
  }
  path.o = path.from = start;
  path.density = value.density;
  return any;
}

void PathWave::advance() {
  for (std::size_t i = 0; i < active_.size(); ++i) {
    Path& path = paths_[active_[i]];
    if (leave(path, hits_[i])) active_[i] = -1;
  }
  for (std::size_t k = 0; k < met_.size(); ++k) {
    int& index = active_[met_[k]];
    if (!reflect(index, met_hits_[k], surfaces_[k], points_[k])) index = -1;
  }
  std::erase(active_, -1);
}

// Transparent surfaces let a part of the light through.
void PathWave::trace_shadows() {
  while (!shadows_.empty()) {
    rays_.clear();
    for (const Shadow& s : shadows_)
      rays_.push_back(ray_of(s.o, s.d, s.geom < 0 ? s.distance : s.distance * 1.001 + 1e-4));
    hits_.resize(rays_.size());
    scene_.trace(rays_, PathScene::Stops::kLight, hits_);
    std::vector<Shadow> through;
    for (std::size_t i = 0; i < shadows_.size(); ++i) {
      Shadow s = shadows_[i];
      const PathHit& hit = hits_[i];
      Path& path = paths_[s.path];
      if (hit.geom < 0) {
        if (s.geom < 0)
          for (int c = 0; c < 3; ++c) path.radiance[c] += s.light[c];
        continue;
      }
      const bool found =
          hit.geom == s.geom && std::abs(hit.t - s.distance) <= 1e-3 * s.distance + 1e-4;
      if (!found && !lets_light_through(scene_.view().geoms[hit.geom])) continue;
      const Vec3 point = advanced(s.o, hit.t, s.d);
      PathSurface surface;
      find_surfaces(scene_.view(), {&hit, 1}, {&point, 1}, {&surface, 1});
      if (found) {
        for (int c = 0; c < 3; ++c) path.radiance[c] += s.light[c] * surface.glow[c];
        continue;
      }
      if (dot(vec3(hit.n), s.d) < 0)
        for (double& c : s.light) c *= 1 - surface.alpha;
      const double step = hit.t + clearance(point, hit.t);
      s.o = advanced(s.o, step, s.d);
      s.distance -= step;
      if (s.distance > 0)
        through.push_back(s);
      else if (s.geom < 0)
        for (int c = 0; c < 3; ++c) path.radiance[c] += s.light[c];
    }
    shadows_ = std::move(through);
  }
}

void PathWave::add_samples(int x0, int x1, int y0, int y1, int first, int last,
                           std::vector<double>& sum) {
  paths_.clear();
  pixels_.clear();
  active_.clear();
  for (int sample = first; sample < last; ++sample) start(x0, x1, y0, y1, sample);
  // Paths from the camera see fewer geoms than reflected ones; they are traced on their own.
  std::vector<int> reflected;
  for (bool camera = true; !active_.empty();) {
    trace(camera ? PathScene::Stops::kSight : PathScene::Stops::kLight);
    advance();
    trace_shadows();
    if (!camera) continue;
    std::vector<int> passing;
    for (int i : active_) (paths_[i].reflections > 0 ? reflected : passing).push_back(i);
    active_ = std::move(passing);
    if (!active_.empty()) continue;
    active_.swap(reflected);
    camera = false;
  }
  for (std::size_t i = 0; i < paths_.size(); ++i)
    for (int c = 0; c < 3; ++c) pixels_[i].rgb[c] = static_cast<float>(paths_[i].radiance[c]);
  add_background(scene_.view(), pixels_);
  for (std::size_t i = 0; i < 3 * pixels_.size(); ++i)
    sum[i % sum.size()] += pixels_[i / 3].rgb[i % 3];
}

}  // namespace mjsense::render
