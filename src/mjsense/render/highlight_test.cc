// SPDX-License-Identifier: Apache-2.0
// The threshold below which highlights are skipped must not remove a visible highlight.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mjsense/render/kernels/shading.h"
#include "mjsense/render/view/geom_surface.h"

namespace mjsense::render {
namespace {

TEST(Highlight, IsZeroBelowTheThreshold) {
  for (float exponent : {0.0f, 1.0f, 3.9f, 4.0f, 13.0f, 27.5f, 64.0f, 128.0f, 1000.0f, 1e5f}) {
    const float highlight_threshold = highlight_threshold_of(exponent);
    const auto of = [&](float x) { return first_lane(power(splat(x), splat(exponent))); };
    if (exponent < 4) {
      EXPECT_LT(highlight_threshold, 0) << exponent;
      continue;
    }
    const float x = std::sqrt(highlight_threshold);
    for (float part : {0.0f, 0.5f, 0.99f, 1.0f}) EXPECT_EQ(of(part * x), 0) << exponent;
    EXPECT_GT(of(std::min(1.0f, std::pow(1.1f * x, 0.8f))), 0) << exponent;
  }
}

}  // namespace
}  // namespace mjsense::render
