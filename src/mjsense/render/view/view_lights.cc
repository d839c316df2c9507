// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/view_lights.h"

#include <algorithm>

#include "mjsense/rays/ray_world.h"
#include "mjsense/render/view/camera_axes.h"
#include "mjsense/render/view/soft_lights.h"

namespace mjsense::render {
namespace {

constexpr float kAmbientOfNoLights = 0.3f;  // as in MuJoCo, so that the image is not black

void place_light(const double light_position[3], const double direction[3],
                 const double position[3], const double rotation[9], ViewLight& light) {
  const double offset[3] = {light_position[0] - position[0], light_position[1] - position[1],
                            light_position[2] - position[2]};
  double p[3], d[3];
  rotate_back(rotation, offset, p);
  rotate_back(rotation, direction, d);
  for (int k = 0; k < 3; ++k) {
    light.pos[k] = static_cast<float>(p[k]);
    light.dir[k] = static_cast<float>(d[k]);
  }
}

void turn_to_camera(const double rotation[9], float v[3]) {
  const double in_world[3] = {v[0], v[1], v[2]};
  double in_camera[3];
  rotate_back(rotation, in_world, in_camera);
  for (int k = 0; k < 3; ++k) v[k] = static_cast<float>(in_camera[k]);
}

// Light `i`, as several ones if it has a radius.
void add_light(const rays::RayLight& source, const Appearance& appearance, std::size_t i,
               int shadow_samples, ViewLight light, const double position[3],
               const double rotation[9], View& view) {
  light.radius = appearance.light_radii()[i];
  const int count = light_samples(appearance, i, shadow_samples);
  for (float* rgb : {light.ambient, light.diffuse, light.specular}) {
    for (int k = 0; k < 3 && count > 1; ++k) rgb[k] /= static_cast<float>(count);
  }
  for (int k = 0; k < count; ++k) {
    double from[3] = {source.pos[0], source.pos[1], source.pos[2]};
    if (count > 1) sample_position(source.pos, appearance.light_radii()[i], k, count, from);
    place_light(from, source.dir, position, rotation, light);
    view.lights[view.num_lights++] = light;
  }
}

}  // namespace

void set_lights(const rays::RayWorld& world, const Appearance& appearance,
                const ViewOptions& options, const double position[3], const double rotation[9],
                const double* headlight, View& view) {
  view.num_lights = 0;
  std::fill_n(view.warp.ambient, 3, 0.0f);
  for (const ViewLight& light : appearance.lights()) {
    for (int k = 0; k < 3; ++k) view.warp.ambient[k] += light.ambient[k];
  }
  view.global_ambient = appearance.lights().empty() ? kAmbientOfNoLights : 0.0f;
  for (std::size_t i = 0; i < appearance.lights().size(); ++i) {
    ViewLight light = appearance.lights()[i];
    const int id = appearance.light_ids()[i];
    const bool is_headlight = id < 0;
    if (view.physical.on)
      set_physical(options.physical, is_headlight ? 0 : appearance.light_intensities()[i],
                   is_headlight ? 0 : appearance.light_ranges()[i], light);
    if (is_headlight) {
      double d[3] = {0, 0, -1};
      if (headlight) rotate_back(rotation, headlight, d);
      for (int k = 0; k < 3; ++k) light.dir[k] = static_cast<float>(d[k]);
      view.lights[view.num_lights++] = light;
    } else {
      add_light(world.lights()[id], appearance, i, options.shadow_samples, light, position,
                rotation, view);
    }
  }
}

void set_lights(const DrawnScene& scene, const double position[3], const double rotation[9],
                View& view) {
  view.num_lights = static_cast<int>(scene.lights.size());
  view.global_ambient = scene.lights.empty() ? kAmbientOfNoLights : 0.0f;
  for (int i = 0; i < view.num_lights; ++i) {
    ViewLight& light = view.lights[i] = scene.lights[i];
    const double from[3] = {light.pos[0], light.pos[1], light.pos[2]};
    const double to[3] = {light.dir[0], light.dir[1], light.dir[2]};
    place_light(from, to, position, rotation, light);
    if (scene.physical) set_physical(*scene.physical, scene.intensities[i], scene.ranges[i], light);
    for (float* axis : light.shadow_map_axes) turn_to_camera(rotation, axis);
  }
}

}  // namespace mjsense::render
