// SPDX-License-Identifier: Apache-2.0
#pragma once
// What an image depends on besides poses: colours, materials and lights, as one world has them.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/rays/flex_surface.h"
#include "mjsense/render/view/view.h"

namespace mjsense {

struct Material {
  float specular, shininess, emission, reflectance;
  int texture;      // id; -1: none
  float repeat[2];  // of a 2D texture
  bool uniform;     // repeat is per metre, not per geom
};

// mjModel's vis.map and vis.rgba, as far as the sky is concerned.
struct Sky {
  float distance;  // m, of the cylinder that MuJoCo paints it on
  float haze_width;
  float haze_rgb[3];
};

inline constexpr int kClassicLights = 8;  // OpenGL's, and so those of MuJoCo's classic renderer

class Appearance {
 public:
  // max_lights: of those that are on, the headlight first, so many shine; up to View::kMaxLights.
  explicit Appearance(const mjModel* model, int max_lights = kClassicLights);
  void copy(const mjModel* model);  // no allocation

  // [geoms, then parts of flexes, then skins; 4] as MuJoCo's visualiser resolves it
  std::span<const float> rgba() const { return rgba_; }
  std::span<const Material> materials() const { return materials_; }  // [nmat]
  const Sky& sky() const { return sky_; }
  // Active ones; no poses yet.
  std::span<const ViewLight> lights() const { return {lights_.data(), num_lights_}; }
  std::span<const int> light_ids() const { return light_ids_; }  // -1: the headlight

 private:
  void copy_lights(const mjModel* model);

  int max_lights_;
  std::vector<FlexPart> flex_parts_;
  std::vector<float> rgba_;
  std::vector<Material> materials_;
  Sky sky_;
  std::vector<ViewLight> lights_;
  std::vector<int> light_ids_;
  std::size_t num_lights_ = 0;
};

}  // namespace mjsense
