// SPDX-License-Identifier: Apache-2.0
// Debug drawing of a ray sensor.

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/sensors/raycast/raycast_sensor.h"

namespace mjsense::sensors {

// A sphere at each hit; if cfg().viz enables them, arrows along each ray and along the surface
// normal.
void RayCastSensor::draw(const World& world, DebugShapes& shapes) {
  const RayCastVizCfg& viz = cfg_.viz;
  const double unit = shapes.meansize(), width = viz.ray_width * unit;
  const double miss_length = std::min(0.5, 0.05 * cfg_.max_distance);
  const std::span<const float> distances = distances_->data.row<float>(world.id);
  const float* hits = hit_pos_->data.row<float>(world.id).data();
  const float* normals = normals_->data.row<float>(world.id).data();
  const auto label = [&](const char* what, int ray) {
    return fmt::format("{}_{}_{}", name(), what, ray);
  };
  const auto vec = [](const float* v, int i) { return Vec3{v[3 * i], v[3 * i + 1], v[3 * i + 2]}; };
  for (int r = 0; r < num_rays(); ++r) {
    const WorldRay ray = world_ray(world.id, r);
    const Vec3 origin = vec3(ray.origin.data()), direction = vec3(ray.direction.data());
    if (distances[r] < 0) {
      if (viz.show_rays)
        shapes.add_arrow(origin, origin + miss_length * direction, width, viz.miss_color,
                         label("ray", r));
      continue;
    }
    const Vec3 hit = vec(hits, r);
    shapes.add_sphere(hit, viz.hit_radius * unit, viz.hit_color, label("hit", r));
    if (viz.show_rays) shapes.add_arrow(origin, hit, width, viz.ray_color, label("ray", r));
    if (viz.show_normals)
      shapes.add_arrow(hit, hit + viz.normal_length * unit * vec(normals, r), width,
                       viz.normal_color, label("normal", r));
  }
}

}  // namespace mjsense::sensors
