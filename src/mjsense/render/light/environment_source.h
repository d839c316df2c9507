// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where the light from the surroundings comes from: the studio, a model's textures, or a file.

#include <mujoco/mujoco.h>

#include <memory>
#include <string>

#include "mjsense/render/light/environment_image.h"
#include "mjsense/render/light/environment_light.h"

namespace mjsense::render {

// `name`: "studio"; "skybox", that of the model; "model", its first active image light with a cube
// texture, else the studio; "auto", that image light, else the skybox, else the studio; or the path of
// an .hdr file.
// Equal surroundings are prepared once for the process. Throws ValueError or KeyError.
std::shared_ptr<const Environment> environment(const mjModel* model, const std::string& name);

// The model's first active image light with a cube texture; -1: none.
int image_light_of(const mjModel* model);

// Prepares an image, scaled so that the mean luminance of all directions is 1. The work is divided
// among all CPUs; the result does not depend on their number.
std::shared_ptr<const Environment> prepared(EnvironmentImage image);

}  // namespace mjsense::render
