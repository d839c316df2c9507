// SPDX-License-Identifier: Apache-2.0
#pragma once
// What the images of an abstract scene are read from.

#include <cstddef>

#include "mjsense/render/view/view.h"

namespace mjsense::render {

// Values of the model that MuJoCo's renderers read when they are made.
struct SceneSettings {
  int samples = 1;  // per pixel of rgb
  bool shadows = true;
  float shadow_clip = 0, shadow_scale = 0;  // m; relative to a spot light's cutoff
  float shadow_near = 0;                    // m
  float haze_width = 0, haze_rgb[3] = {};
  Fog fog;
  float line_width = 1;              // pixels
  bool projected_textures = false;   // DrawnScene::projected_textures
  bool sized_soft_textures = false;  // DrawnScene::sized_soft_textures
  // As in MuJoCo before 3.12, a point or image light shines from the camera's direction. Later
  // versions do not draw it.
  bool point_lights_at_camera = false;
};

// Arrays of an mjvScene that hold flexes and skins; null if there are none.
struct SoftArrays {
  int num_flexes = 0;
  const int *flexedgeadr = nullptr, *flexedgenum = nullptr, *flexedge = nullptr;
  const int *flexvertadr = nullptr, *flexvertnum = nullptr;
  const int *flexfaceadr = nullptr, *flexfaceused = nullptr;
  const float *flexvert = nullptr, *flexface = nullptr, *flexnormal = nullptr,
              *flextexcoord = nullptr;
  const int *skinfacenum = nullptr, *skinvertadr = nullptr, *skinvertnum = nullptr;
  const float *skinvert = nullptr, *skinnormal = nullptr;
};

// The memory of an mjvScene. Addresses are those of the structs' reference fields.
struct SceneMemory {
  const char* geoms;
  std::ptrdiff_t geom_stride;
  int num_geoms;
  const char* lights;
  std::ptrdiff_t light_stride;
  int num_lights;
  const char* cameras[2];
  bool shadow, reflection, skybox, haze, fog;  // flags mjRND_*
  bool flex_vertices, flex_edges, flex_skin;
  bool point_lights;  // draw point lights at their position, unlike MuJoCo
};

}  // namespace mjsense::render
