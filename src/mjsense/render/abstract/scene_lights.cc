// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/scene_lights.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/physical_light.h"

namespace mjsense::render {
namespace {

constexpr int kSpot = 0, kDirectional = 1, kPoint = 2,
              kImage = 3;  // mjtLightType, the same in all versions

void check(const AbstractLight& light, int index) {
  if (!is_finite(light.pos) || !is_finite(light.dir) || !is_finite(light.ambient) ||
      !is_finite(light.diffuse) || !is_finite(light.specular) || !is_finite(light.attenuation))
    throw ValueError(
        fmt::format("light {} of the scene has a pose or colour that is not finite", index));
}

// The square that MuJoCo's shadow map covers. Its first axis is perpendicular to the light's and to -x
// or y.
void limit_shadows(const SceneSettings& settings, float cutoff, ViewLight& light) {
  const float* d = light.dir;
  float up[3] = {0, -d[2], d[1]};
  float length = up[1] * up[1] + up[2] * up[2];
  if (length <= 0.01f) {
    const float other[3] = {-d[2], 0, d[0]};
    std::copy_n(other, 3, up);
    length = up[0] * up[0] + up[2] * up[2];
  }
  for (int k = 0; k < 3; ++k) light.shadow_map_axes[0][k] = up[k] / std::sqrt(length);
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    light.shadow_map_axes[1][k] =
        d[i] * light.shadow_map_axes[0][j] - d[j] * light.shadow_map_axes[0][i];
  }
  light.shadow_map_half_size = settings.shadow_clip;
  light.shadow_map_near = settings.shadow_near;
  if (light.kind != LightKind::kDirectional) {
    const double fovy = std::min(2.0 * cutoff * settings.shadow_scale, 160.0);
    light.shadow_map_half_size = static_cast<float>(std::tan(fovy * std::numbers::pi / 360));
  }
}

// `point`: a point light that is drawn at its position.
ViewLight view_light(const AbstractLight& light, const SceneSettings& settings, bool directional,
                     bool point) {
  ViewLight out = {};
  out.kind = directional ? LightKind::kDirectional : LightKind::kSpot;
  out.casts_shadows = light.castshadow != 0;
  std::copy_n(light.pos, 3, out.pos);
  std::copy_n(light.dir, 3, out.dir);
  std::copy_n(light.ambient, 3, out.ambient);
  std::copy_n(light.diffuse, 3, out.diffuse);
  std::copy_n(light.specular, 3, out.specular);
  out.attenuation[0] = 1;
  out.radius = light.bulbradius;
  if (out.casts_shadows && !point) limit_shadows(settings, light.cutoff, out);
  if (directional) return out;
  if (!point) std::copy_n(light.attenuation, 3, out.attenuation);  // MuJoCo leaves it at 0
  out.exponent = light.exponent;
  out.cos_cutoff = static_cast<float>(std::cos(light.cutoff * std::numbers::pi / 180));
  if (point || light.cutoff >= 180) out.kind = LightKind::kPoint;
  return out;
}

}  // namespace

// MuJoCo's renderer does not set the position of lights of other types than spot and directional, so
// that it is OpenGL's default: the camera's direction.
void SceneLights::read(const SceneMemory& scene, const SceneSettings& settings,
                       const SceneCamera& camera) {
  lights_.clear();
  intensities_.clear();
  ranges_.clear();
  environment_tint_ = {1, 1, 1};
  bool image_light = false;
  for (int i = 0; i < std::min(scene.num_lights, kClassicLights); ++i) {
    AbstractLight light;
    reader_.read(scene.lights + i * scene.light_stride, light);
    if (light.type == kImage && !image_light) {
      image_light = true;
      environment_tint_ = environment_factors(light.diffuse, light.intensity);
    }
    bool directional = light.type < 0 ? light.directional != 0 : light.type == kDirectional;
    const bool drawn_point = scene.point_lights && light.type == kPoint;
    if (!directional && light.type > kSpot && !drawn_point) {
      if (!settings.point_lights_at_camera) continue;
      directional = true;
      light.castshadow = 0;
      for (int k = 0; k < 3; ++k) light.dir[k] = static_cast<float>(-camera.rotation[3 * k + 2]);
    }
    check(light, i);
    intensities_.push_back(light.intensity);
    ranges_.push_back(light.range);
    lights_.push_back(view_light(light, settings, directional, drawn_point));
  }
}

float SceneLights::ambient() const {
  float sum = lights_.empty() ? 0.3f : 0.0f;
  for (const ViewLight& light : lights_) sum += light.ambient[0];
  return sum;
}

}  // namespace mjsense::render
