// SPDX-License-Identifier: Apache-2.0
#pragma once
// MuJoCo's own OpenGL renderer, offscreen. It serves as a reference for comparing images, and for
// users who need exactly its look. Requires a build with MJSENSE_OPENGL and, at run time, libEGL
// and a driver (e.g. Mesa's llvmpipe).

#include <mujoco/mujoco.h>

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "mjsense/render/view/image_targets.h"

namespace mjsense::rays {
class RayWorld;
}  // namespace mjsense::rays

namespace mjsense::render {

struct GlRendererCfg {
  int num_worlds = 1;
  int camera = 0;
  int width = 0, height = 0;
  unsigned groups = 0x7;  // bit g: geoms of group g
  bool textures = true, shadows = true;
  int samples = 1;
  int max_lights = 8;
  std::size_t markers = 0;  // maximum number of markers
  // Override the model's camera.
  std::optional<double> fovy;  // degrees; orthographic: m
  bool orthographic = false;
};

class GlRenderer {
 public:
  virtual ~GlRenderer() = default;
  // Copies the world's colours, materials, sizes, lights and field of view. May be called for
  // several worlds in parallel.
  virtual void remember(int world, const mjModel* model) = 0;
  // Writes rgb, depth (planar) and segmentation of `targets`, with the poses of `state`, these
  // markers, and the fields from remember().
  virtual void render(int world, const rays::RayWorld& state, std::span<const mjvGeom> markers,
                      const ImageTargets& targets) = 0;
};

// Throws RuntimeError, with a message that starts with `context`, if OpenGL is not available.
std::unique_ptr<GlRenderer> make_gl_renderer(const mjModel* model, const GlRendererCfg& cfg,
                                             const std::string& context);

}  // namespace mjsense::render
