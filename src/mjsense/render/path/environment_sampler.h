// SPDX-License-Identifier: Apache-2.0
#pragma once
// Random directions towards the surroundings, more of them where they are bright.

#include <array>
#include <vector>

#include "mjsense/render/light/environment_light.h"
#include "mjsense/render/light/material.h"
#include "mjsense/render/light/microfacets.h"

namespace mjsense::render {

// The radiance is that of level 0 of EnvironmentLight::radiance, as images show it: bilinear between the
// texels of a face. A cell between four texels is chosen in proportion to its light; the position within
// it is uniform.
class EnvironmentSampler {
 public:
  explicit EnvironmentSampler(const EnvironmentLight& light);

  // Directions are unit vectors in the environment's frame.
  Rgb64 radiance(const Vec3& direction) const;
  double mean() const { return mean_; }         // luminance over all directions
  double density(const Vec3& direction) const;  // of sample(), 1/sr
  struct Sample {
    Vec3 direction;
    double density;  // 1/sr
    Rgb64 radiance;
  };
  Sample sample(double choice, double u, double v) const;  // uniform numbers in [0, 1); mean() > 0

 private:
  Rgb64 between(int face, int y, int x, double down, double across) const;
  double density(int cell, double s, double t) const;

  int size_;                                  // texels along a face's edge
  std::vector<std::array<float, 3>> texels_;  // [6, size, size]
  std::vector<double> ends_;  // [6, size - 1, size - 1] cumulative probability of the cells
  // [kParts + 1]: the first cell whose end is behind i / kParts. A search then compares one or two cells.
  std::vector<int> starts_;
  double mean_ = 0;
};

}  // namespace mjsense::render
