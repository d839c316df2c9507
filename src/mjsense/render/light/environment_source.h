// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where the light from the surroundings comes from: the studio, a model's textures, or a file.

#include <mujoco/mujoco.h>

#include <array>
#include <memory>
#include <string>

#include "mjsense/render/light/environment_image.h"
#include "mjsense/render/light/environment_light.h"

namespace mjsense::render {

// `name`: "studio"; "skybox", that of the model; "model", the first active image light with a cube
// texture that can be read, else the studio; or the path of an .hdr file. Equal surroundings are
// prepared once for the process. Throws ValueError.
std::shared_ptr<const Environment> environment(const mjModel* model, const std::string& name);

// Prepares an image, scaled so that the mean luminance of all directions is 1. The work is divided
// among all CPUs; the result does not depend on their number.
std::shared_ptr<const Environment> prepared(EnvironmentImage image);

// The texels of EnvironmentLight::radiance.
std::uint32_t pack_rgb9e5(const float rgb[3]);
std::array<float, 3> unpack_rgb9e5(std::uint32_t texel);

}  // namespace mjsense::render
