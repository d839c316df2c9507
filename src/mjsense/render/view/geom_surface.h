// SPDX-License-Identifier: Apache-2.0
#pragma once
// The surface of a geom: its material as the kernels draw it.

#include <array>

#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/surface_assets.h"
#include "mjsense/render/view/view_geom.h"

namespace mjsense::rays {
struct RayGeom;
}  // namespace mjsense::rays

namespace mjsense::render {

inline constexpr float kOpaque = 0.995f;  // MuJoCo blends geoms with a lower alpha

// How all surfaces of a view are drawn.
struct SurfaceStyle {
  const SurfaceAssets* assets = nullptr;  // where the maps of materials are, unless Paint has them
  bool textures = true;
  bool physical = false;
  bool planes_are_infinite = false;  // as in mujoco_warp 3.11: for their textures
  bool projected_textures = false;   // DrawnScene::projected_textures
  bool sized_soft_textures = false;  // DrawnScene::sized_soft_textures
  float tint = 1;                    // factor of every colour
};

// What gives a geom its colours.
struct Paint {
  const float* rgba;                     // [4]
  const Material* material;              // null: none
  const Texture* texture;                // of the material's colours; null: none
  const Texture* const* maps = nullptr;  // [kNumTextureMaps]; null: those of the material
};

// Sets `surface` and `transparent` of `g`, whose shape is set. `source`: the geom in the world.
void set_surface(const SurfaceStyle& style, const rays::RayGeom& source, const Paint& paint,
                 ViewGeom& g);

// The mean of its colours, linear, in a physically based view.
std::array<float, 3> mean_color(const Surface& surface);

// Computes Surface::highlight_threshold: the value below which the kernels' power() returns 0, with a margin for
// rounding. power() returns 0 for x below 0.3 if the exponent is at least 4, and where x^exponent
// is below e^-32.3.
float highlight_threshold_of(float exponent);

}  // namespace mjsense::render
