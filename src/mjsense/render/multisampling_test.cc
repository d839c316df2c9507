// SPDX-License-Identifier: Apache-2.0
// Each pixel of a multisampled image has the colour at its centre, or the mean of the colours at its
// four samples.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::Picture;
using testing::TestRenderer;

// OpenGL's places of four samples, in pixels.
constexpr double kPlaces[4][2] = {
    {-1 / 8., -3 / 8.}, {3 / 8., -1 / 8.}, {-3 / 8., 1 / 8.}, {1 / 8., 3 / 8.}};

// Balls of 5,120 triangles. `wall`: they stick out of a leaning wall with a gap between the centres of
// two columns of pixels, so that only samples see what is behind the wall.
std::string balls(bool wall) {
  Rng rng(3, 0, 0, 0);
  std::string xml =
      "<visual><headlight ambient='.3 .3 .3' diffuse='.7 .7 .7' specular='0 0 0'/></visual><asset>"
      "<mesh name='ball' builtin='sphere' params='4'/></asset><worldbody>";
  for (int i = 0; i < (wall ? 5 : 60); ++i) {
    const double x = wall ? rng.uniform(-1.02, -.9) : rng.uniform(-4, 4);
    const double y = rng.uniform(-3, 3), z = wall ? rng.uniform(1.1, 1.4) : rng.uniform(-9, 2);
    xml += fmt::format("<geom type='mesh' mesh='ball' pos='{} {} {}' rgba='{} .5 {} 1'/>", x, y, z,
                       rng.uniform(0, 1), rng.uniform(0, 1));
  }
  for (int side = -1; wall && side <= 1; side += 2)
    xml +=
        fmt::format("<geom type='box' size='5 9 .01' pos='{} 0 2' euler='3 0 0'/>", 5.025 * side);
  return xml + "</worldbody>";
}

TEST(Multisampling, PixelsAreThoseOfTheirSamples) {
  for (const bool wall : {false, true}) {
    TestRenderer s(balls(wall));
    constexpr int kWidth = 96, kHeight = 80;
    const double fovy = 2 * 180 / std::numbers::pi * std::atan(4. / 6);
    PixelGrid grid = grid_from_fovy(kWidth, kHeight, fovy, false);
    grid.left -= 5 * grid.dx;  // the gap is in the middle of a tile
    const auto take = [&](double x, double y) {
      PixelGrid shifted = grid;
      shifted.left += static_cast<float>(x) * grid.dx;
      shifted.top += static_cast<float>(y) * grid.dy;
      return s.take({0, 0, 8}, {1, 0, 0}, {0, 1, 0}, shifted);
    };
    const Picture center = take(0, 0);
    std::vector<Picture> samples;
    for (const auto& [x, y] : kPlaces) samples.push_back(take(x, -y));
    ViewBuilder builder(s.model.get(), *s.assets, s.options);
    std::vector<std::uint8_t> rgb(3 * kWidth * kHeight);
    ImageTargets targets;
    targets.rgb = rgb.data();
    targets.samples = 4;
    targets.multisampled = true;
    s.draw(s.view(builder, {0, 0, 8}, {1, 0, 0}, {0, 1, 0}, grid), targets);
    int averaged = 0, missed = 0;
    for (std::size_t i = 0; i < rgb.size(); ++i) {
      double mean = 0;
      bool edge = false;
      for (const Picture& sample : samples) {
        mean += sample.rgb[i] / 4.;
        edge |= sample.ids[2 * (i / 3)] != center.ids[2 * (i / 3)];
      }
      const bool is_mean = std::abs(rgb[i] - mean) < 1.1, is_center = rgb[i] == center.rgb[i];
      ASSERT_TRUE(is_mean || is_center) << wall << " " << i << ": " << int(rgb[i]) << ", mean "
                                        << mean << ", centre " << int(center.rgb[i]);
      averaged += is_mean && !is_center;
      missed += edge && !is_mean;
    }
    EXPECT_GT(averaged, wall ? 200 : 1000);
    EXPECT_LT(missed, 100) << wall;
  }
}

}  // namespace
}  // namespace mjsense::render
