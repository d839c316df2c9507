// SPDX-License-Identifier: Apache-2.0
#pragma once
// Colours, materials and lights of one world: everything an image depends on besides poses.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/rays/flex_surface.h"
#include "mjsense/render/light/material.h"
#include "mjsense/render/view/texture_maps.h"
#include "mjsense/render/view/view_light.h"
#include "mjsense/render/view/warp_look.h"

namespace mjsense::render {

struct Material {
  float specular, shininess, emission, reflectance;
  float metallic = 0, roughness = -1;  // 0..1; roughness -1: 1 - shininess
  int texture;                         // id; -1: none
  float repeat[2];                     // of a 2D texture
  bool uniform;                        // `repeat` is per metre instead of per geom
  TextureIds textures = kNoTextures;   // by role; physically based views use all of them
};

// The fields of mjModel's vis.map and vis.rgba that affect the sky.
struct Sky {
  float distance;  // m, radius of the cylinder on which MuJoCo draws it
  float haze_width;
  float haze_rgb[3];
};

// Number of lights in OpenGL, and thus in MuJoCo's classic renderer.
inline constexpr int kClassicLights = 8;

class Appearance {
 public:
  // max_lights: maximum number of active lights that are used, counting the headlight first; at
  // most kMaxLights. warp: geoms are opaque, without reflections.
  explicit Appearance(const mjModel* model, int max_lights = kClassicLights,
                      const WarpLook& warp = {});
  void copy(const mjModel* model);  // no allocation

  // [geoms, then parts of flexes, then skins; 4], resolved as by MuJoCo's visualiser
  std::span<const float> rgba() const { return rgba_; }
  std::span<const Material> materials() const { return materials_; }  // [nmat]
  const Sky& sky() const { return sky_; }
  // Active lights, without poses.
  std::span<const ViewLight> lights() const { return {lights_.data(), num_lights_}; }
  std::span<const int> light_ids() const { return light_ids_; }        // -1: the headlight
  std::span<const float> light_radii() const { return light_radii_; }  // m
  // For physically based shading: candela, or lux for directional lights, 0: not set; m.
  std::span<const float> light_intensities() const { return light_intensities_; }
  std::span<const float> light_ranges() const { return light_ranges_; }
  // Of the image light, environment_factors().
  const Rgb64& environment_tint() const { return environment_tint_; }

 private:
  void apply_warp_look(const mjModel* model);
  void copy_lights(const mjModel* model);

  int max_lights_;
  WarpLook warp_;
  std::vector<rays::FlexPart> flex_parts_;
  std::vector<float> rgba_;
  std::vector<Material> materials_;
  Sky sky_;
  std::vector<ViewLight> lights_;
  std::vector<int> light_ids_;
  std::vector<float> light_radii_, light_intensities_, light_ranges_;
  Rgb64 environment_tint_;
  std::size_t num_lights_ = 0;
};

}  // namespace mjsense::render
