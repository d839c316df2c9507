// SPDX-License-Identifier: Apache-2.0
#pragma once
// Path-traced images: the reference for physically based shading. Light is followed from the pixels over
// any number of reflections, so that the expected value of an image is the solution of the rendering
// equation (J. Kajiya, The Rendering Equation, SIGGRAPH 1986) for the materials and lights of
// physically based views. Its noise falls at least with the square root of the number of samples.
//
// A pixel is the mean of its samples, which are uniform in its square. At each surface one light is
// chosen (path_lights.h), and the direction of the reflection is drawn from the material (scatter.h); both
// are weighted by multiple importance sampling. After a few reflections, paths end at random
// (Russian roulette). Random numbers depend on the pixel and the number of the sample only.
//
// Differences from images of the kernels besides light: transparent geoms let light through; planes seen from
// behind are not shown as a veil.

#include <cstdint>
#include <memory>

#include "mjsense/render/path/path_lights.h"
#include "mjsense/render/path/path_scene.h"

namespace mjsense::render {

class PathTracer {
 public:
  PathTracer(int samples, std::shared_ptr<const EnvironmentSampler> environment)
      : samples_(samples), lights_(std::move(environment)) {}

  // As for PathScene::build(). Several threads may then render different rows.
  void build(const View& view);
  // Renders rows of tiles [first, last) of an image into the targets rgb and hdr, of those that are not
  // null.
  void render(int first, int last, const ImageTargets& targets) const;

 private:
  int samples_;
  PathScene scene_;
  PathLights lights_;
};

}  // namespace mjsense::render
