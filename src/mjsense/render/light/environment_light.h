// SPDX-License-Identifier: Apache-2.0
#pragma once
// Light from the surroundings of a scene, prepared for the kernels. Frame: the world's, z up.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "mjsense/render/view/stored_texture.h"

namespace mjsense::render {

struct EnvironmentLight {
  // Radiance of a white matte surface of normal n: the sum of these coefficients times 1, y, z, x, xy, yz,
  // 3 z^2 - 1, xz, x^2 - y^2.
  float irradiance[9][3];
  // Cube map of GL_RGB9_E5 texels. Level l is the radiance that a specular lobe of perceptual roughness
  // l / (levels - 1) sees, with n = v = r. The texels at the border of a face are on its edges, so that
  // neighbouring faces have equal texels there: texel (x, y) of n x n shows s = -1 + 2 x / (n - 1).
  Texture radiance;
};

// An environment with its memory.
struct Environment {
  EnvironmentLight light;
  std::vector<std::uint32_t> texels;
};

// The texels of EnvironmentLight::radiance.
std::uint32_t pack_rgb9e5(const float rgb[3]);
std::array<float, 3> unpack_rgb9e5(std::uint32_t texel);

// An environment without colour whose radiance depends only on z of the direction.
std::shared_ptr<const Environment> upright_environment(
    const std::function<double(double)>& radiance);

// A bright room: a floor, walls, and a wide lamp above. A white matte surface has a mean radiance of 1.
std::shared_ptr<const Environment> studio();

}  // namespace mjsense::render
