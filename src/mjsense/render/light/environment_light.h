// SPDX-License-Identifier: Apache-2.0
#pragma once
// Light from the surroundings of a scene, prepared for the kernels.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/render/view/stored_texture.h"

namespace mjsense::render {

struct EnvironmentLight {
  float irradiance[9][3];
  Texture radiance;
};

struct Environment {
  EnvironmentLight light;
  std::vector<std::uint32_t> texels;
};

std::shared_ptr<const Environment> environment(const mjModel* model, const std::string& what);

}  // namespace mjsense::render
