// SPDX-License-Identifier: Apache-2.0
#pragma once
// The look of mujoco_warp's images instead of that of MuJoCo's classic renderer.

namespace mjsense::render {

inline constexpr float kWarpShareInShadow = 0.3f;

struct WarpLook {
  bool on = false;
  // The colours of geoms and the textures of planes are MuJoCo's, as in mujoco_warp 4.0. In 3.11, a
  // geom has the colour of its material, and all planes are textured like infinite ones.
  bool series_4 = false;
  bool vertex_normals = false;                 // of meshes, otherwise those of their faces
  float share_in_shadow = kWarpShareInShadow;  // of the light that hidden points receive
  bool skybox = false;                         // which hides no geoms

  bool operator==(const WarpLook&) const = default;
};

}  // namespace mjsense::render
