// SPDX-License-Identifier: Apache-2.0
#pragma once
// The lights of an abstract scene.

#include <utility>
#include <vector>

#include "mjsense/render/abstract/abstract_scene.h"
#include "mjsense/render/abstract/scene_camera.h"
#include "mjsense/render/abstract/scene_memory.h"
#include "mjsense/render/light/material.h"
#include "mjsense/render/view/view_light.h"

namespace mjsense::render {

class SceneLights {
 public:
  explicit SceneLights(StructReader reader) : reader_(std::move(reader)) {}

  // As in OpenGL, only the first lights are used. Throws ValueError for values that are not finite.
  void read(const SceneMemory& scene, const SceneSettings& settings, const SceneCamera& camera);

  const std::vector<ViewLight>& lights() const { return lights_; }  // poses in the world frame
  // By light, for physically based shading: candela or lux (0: not set), m.
  const std::vector<float>& intensities() const { return intensities_; }
  const std::vector<float>& ranges() const { return ranges_; }
  const Rgb64& environment_tint() const { return environment_tint_; }  // of the image light
  // Red component of the ambient light of all lights together.
  float ambient() const;

 private:
  StructReader reader_;
  std::vector<ViewLight> lights_;
  std::vector<float> intensities_, ranges_;
  Rgb64 environment_tint_;
};

}  // namespace mjsense::render
