// SPDX-License-Identifier: Apache-2.0
#pragma once
// A light of a view, with MuJoCo's classic lighting model.

#include <cstdint>

namespace mjsense::render {

inline constexpr int kMaxLights = 32;  // in a view

enum class LightKind : std::uint8_t { kDirectional, kSpot, kPoint };

// Vectors are in the camera's frame. Colours are in [0, 1]; in a physically based view, `diffuse` is
// the radiance of a white matte surface that faces the light, in the units of PhysicalView, and the
// other colours are not used.
struct ViewLight {
  LightKind kind;
  bool casts_shadows;
  float pos[3], dir[3];  // m; direction in which it shines, any length
  float ambient[3], diffuse[3], specular[3];
  float attenuation[3];        // 1 / (a[0] + a[1] d + a[2] d^2) at the distance d in m
  float cos_cutoff, exponent;  // for spot lights
  float range;                 // m, distance at which it fades to 0; 0: unlimited
  float radius;                // m, of the ball that shines; used by path tracing
  // MuJoCo renders a shadow map: a square around the light's axis, outside of which there are no
  // shadows. Its axes are unit vectors. Its half size is in m or, for spot lights, relative to the
  // distance along the light's axis. Not positive: shadows are not limited.
  float shadow_map_axes[2][3], shadow_map_half_size;
  // With such a limit: distance from the light along its axis up to which geoms cast no shadow, m.
  float shadow_map_near;

  bool operator==(const ViewLight&) const = default;
};

}  // namespace mjsense::render
