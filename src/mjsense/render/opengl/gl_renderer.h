// SPDX-License-Identifier: Apache-2.0
#pragma once
// MuJoCo's own OpenGL renderer, offscreen, as a reference: for comparing pictures, and for those
// who want exactly its look. Present when the library was built with MJSENSE_OPENGL; needs libEGL
// and a driver (Mesa's llvmpipe does) at run time.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "mjsense/render/view/view.h"

namespace mjsense {

class RayWorld;

struct GlRendererCfg {
  int num_worlds = 1;
  int camera = 0;
  int width = 0, height = 0;
  unsigned groups = 0x7;  // bit g: geoms of group g
  bool textures = true, shadows = true;
  int samples = 1;
  int max_lights = 8;
  std::size_t markers = 0;  // at most so many
  // Instead of what the model says of the camera.
  std::optional<double> fovy;  // degrees; orthographic: m
  bool orthographic = false;
};

class GlRenderer {
 public:
  virtual ~GlRenderer() = default;
  // Takes the world's own colours, materials, sizes, lights and field of view. Worlds in parallel.
  virtual void remember(int world, const mjModel* model) = 0;
  // Fills rgb, depth (planar) and segmentation of `targets`; poses as `state` has them, markers as
  // given, the rest as remembered.
  virtual void render(int world, const RayWorld& state, std::span<const mjvGeom> markers,
                      const ImageTargets& targets) = 0;
};

// Throws RuntimeError, beginning with `place`, if there is no OpenGL to be had.
std::unique_ptr<GlRenderer> make_gl_renderer(const mjModel* model, const GlRendererCfg& cfg,
                                             const std::string& place);

}  // namespace mjsense
