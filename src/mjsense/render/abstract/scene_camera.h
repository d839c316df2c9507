// SPDX-License-Identifier: Apache-2.0
#pragma once
// The camera of an abstract scene.

#include "mjsense/render/abstract/abstract_scene.h"
#include "mjsense/render/abstract/scene_memory.h"
#include "mjsense/render/view/pixel_grid.h"

namespace mjsense::render {

struct SceneCamera {
  double position[3], rotation[9];  // X_WC, row-major
  float near = 0, far = 0;          // m
  PixelGrid grid;
};

// The camera between the left and the right one, as MuJoCo does without stereo. Throws ValueError for
// values that are not finite and for a camera without a direction.
SceneCamera read_camera(const StructReader& reader, const SceneMemory& scene, int width,
                        int height);

}  // namespace mjsense::render
