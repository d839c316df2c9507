// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/core/system/cpu.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/render/kernels/tile_memory.h"
#include "mjsense/render/testing/test_renderer.h"
#include "mjsense/render/view/camera_model.h"
#include "mjsense/render/view/view_builder.h"

namespace mjsense::render {
namespace {

using testing::expect_pixel;
using testing::kAmbient;
using testing::kDark;
using testing::kMatte;
using testing::Pixel;
using testing::TestRenderer;

int rounded(double value) { return static_cast<int>(std::lround(value)); }

TEST(Shading, HeadlightIsAmbientPlusDiffuseTimesCosine) {
  TestRenderer s(std::string(kMatte) +
                 R"(<worldbody><geom type="plane" size="5 5 1" material="matte"/></worldbody>)");
  // Default headlight: ambient 0.1, diffuse 0.4.
  expect_pixel(s.from_above(0, 0), {128, 64, 26});
  // From 45 degrees the headlight meets the floor at 45 degrees.
  const double h = std::sqrt(0.5), v = 255 * (0.1 + 0.4 * h);
  expect_pixel(s.center({0, -2, 2}, {1, 0, 0}, {0, h, h}, 1),
               {rounded(v), rounded(v / 2), rounded(v / 5)});
}

TEST(Shading, SpotHasAConeAnExponentAndAttenuation) {
  TestRenderer s(std::string(kDark) + kMatte + R"(<worldbody>
    <light pos="0 0 2" dir="0 0 -1" cutoff="30" exponent="2" attenuation="0 .5 .25" diffuse="1 1 1" specular="0 0 0"
           castshadow="false"/>
    <geom type="plane" size="5 5 1" material="matte"/></worldbody>)");
  expect_pixel(s.from_above(0, 0, 5), {128, 64, 26});  // attenuation 1 / (.5 * 2 + .25 * 4)
  const double d = std::sqrt(5.0), cosine = 2 / d;     // one metre to the side
  const double value = cosine * cosine * cosine / (0.5 * d + 0.25 * d * d);
  expect_pixel(s.from_above(1, 0, 5),
               {rounded(255 * value), rounded(127.5 * value), rounded(51 * value)});
  expect_pixel(s.from_above(1.3, 0, 5), {0, 0, 0});  // 33 degrees: outside the cone
}

TEST(Shading, SpecularHighlightFollowsTheHalfVector) {
  TestRenderer s(
      std::string(kDark) +
      R"(<asset><material name="m" rgba="0 0 0 1" specular=".5" shininess=".25"/></asset><worldbody>
    <light pos="1 0 2" dir="0 0 -1" type="directional" diffuse="1 1 1" specular="1 1 1" castshadow="false"/>
    <geom type="plane" size="5 5 1" material="m"/></worldbody>)");
  expect_pixel(s.from_above(0, 0), {128, 128, 128});
  // Seen from 60 degrees, the half vector is 30 degrees off the normal: cos^32.
  const double v = 0.5 * std::pow(std::cos(M_PI / 6), 32) * 255;
  const double c = 0.5, sn = std::sqrt(0.75);
  expect_pixel(s.center({0, -2 * sn, 2 * c}, {1, 0, 0}, {0, c, sn}, 1),
               {rounded(v), rounded(v), rounded(v)});
}

TEST(Shading, ShadowsHaveSharpEdges) {
  // A box of half size 0.2 at height 1, light at height 3: its shadow reaches to 0.2 * 3 / 1.8 =
  // 1/3.
  TestRenderer s(std::string(kDark) + kMatte + R"(<worldbody>
    <light pos="0 0 3" dir="0 0 -1" diffuse="1 1 1" specular="0 0 0" castshadow="true" cutoff="80" exponent="0"/>
    <geom type="plane" size="5 5 1" material="matte"/><geom type="box" size=".2 .2 .2" pos="0 0 1" material="matte"/>
    </worldbody>)");
  const std::array<double, 3> x{1, 0, 0}, y{0, 1, 0};
  s.options.shadows = true;
  EXPECT_EQ(s.center({0.32, 0, 0.5}, x, y, 1)[0], 0);
  EXPECT_GT(s.center({0.35, 0, 0.5}, x, y, 1)[0], 200);
  EXPECT_GT(s.center({0, 0, 2}, x, y, 1)[0], 200);  // on the box itself
  s.options.shadows = false;
  EXPECT_GT(s.center({0.32, 0, 0.5}, x, y, 1)[0], 200);
}

TEST(Texture, PlaneStartsAtTheCornerAndRepeats) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<asset><texture name="t" type="2d" builtin="flat" width="2" height="2"/>
    <material name="m" texture="t" texrepeat="2 1"/></asset><worldbody>
    <geom type="plane" size="1 1 1" material="m"/></worldbody>)");
  const std::array<Pixel, 4> texels{{{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 255}}};
  s.paint(0, [&](int i) { return texels[i]; });
  // In x: two repeats of two texels, centred at x = -.75 -.25 .25 .75. Row 0 of the image is at +y.
  expect_pixel(s.from_above(-0.75, 0.5), texels[0]);
  expect_pixel(s.from_above(-0.25, 0.5), texels[1]);
  expect_pixel(s.from_above(0.25, 0.5), texels[0]);
  expect_pixel(s.from_above(-0.75, -0.5), texels[2]);
  expect_pixel(s.from_above(0.75, -0.5), texels[3]);
  expect_pixel(s.from_above(-0.5, 0.5), {128, 128, 0});  // halfway between two texels
}

TEST(Texture, CubeFacesAndSkyFollowOpenGL) {
  const std::array<Pixel, 6> faces{
      {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 0}, {0, 255, 255}, {255, 0, 255}}};
  TestRenderer s(std::string(kAmbient) +
                 R"(<asset><texture name="t" type="cube" builtin="flat" width="8" height="48"/>
    <texture name="sky" type="skybox" builtin="flat" width="8" height="48"/><material name="m" texture="t"/></asset>
    <worldbody><geom type="box" size=".5 .4 .3" material="m"/></worldbody>)");
  for (int t = 0; t < 2; ++t) s.paint(t, [&](int i) { return faces[i / 64]; });
  expect_pixel(s.center({2, 0, 0}, {0, 1, 0}, {0, 0, 1}), faces[0]);
  expect_pixel(s.center({-2, 0, 0}, {0, -1, 0}, {0, 0, 1}), faces[1]);
  expect_pixel(s.center({0, 2, 0}, {-1, 0, 0}, {0, 0, 1}), faces[2]);
  expect_pixel(s.center({0, -2, 0}, {1, 0, 0}, {0, 0, 1}), faces[3]);
  expect_pixel(s.center({0, 0, 2}, {1, 0, 0}, {0, 1, 0}), faces[4]);
  expect_pixel(s.center({0, 0, -2}, {1, 0, 0}, {0, -1, 0}), faces[5]);
  // The skybox is rotated by 90 degrees about x: its +y face is overhead.
  expect_pixel(s.center({9, 0, 9}, {1, 0, 0}, {0, -1, 0}), faces[2]);
  expect_pixel(s.center({9, 0, 9}, {0, -1, 0}, {0, 0, 1}), faces[0]);
}

// Each face shows the one square image; its left and right halves have different colours.
TEST(Texture, ASquareCubeMapHasTheSameImageOnAllFaces) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<asset><texture name="t" type="cube" builtin="flat" width="8" height="48"/>
    <material name="m" texture="t"/></asset>
    <worldbody><geom type="box" size=".5 .5 .5" material="m"/></worldbody>)");
  s.model->tex_height[0] = 8;
  const std::array<Pixel, 2> halves{{{255, 0, 0}, {0, 0, 255}}};
  s.paint(0, [&](int i) { return halves[i % 8 / 4]; });
  // Camera above the middle of each half of a face, as OpenGL orients faces.
  expect_pixel(s.center({2, 0, 0.25}, {0, 1, 0}, {0, 0, 1}), halves[0]);
  expect_pixel(s.center({2, 0, -0.25}, {0, 1, 0}, {0, 0, 1}), halves[1]);
  expect_pixel(s.center({-2, 0, -0.25}, {0, -1, 0}, {0, 0, 1}), halves[0]);
  expect_pixel(s.center({-2, 0, 0.25}, {0, -1, 0}, {0, 0, 1}), halves[1]);
  for (const double side : {-2.0, 2.0}) {
    expect_pixel(s.center({-0.25, side, 0}, {side < 0 ? 1.0 : -1.0, 0, 0}, {0, 0, 1}), halves[0]);
    expect_pixel(s.center({0.25, side, 0}, {side < 0 ? 1.0 : -1.0, 0, 0}, {0, 0, 1}), halves[1]);
  }
  expect_pixel(s.center({-0.25, 0, 2}, {1, 0, 0}, {0, 1, 0}), halves[0]);
  expect_pixel(s.center({0.25, 0, 2}, {1, 0, 0}, {0, 1, 0}), halves[1]);
  expect_pixel(s.center({0.25, 0, -2}, {1, 0, 0}, {0, -1, 0}), halves[0]);
  expect_pixel(s.center({-0.25, 0, -2}, {1, 0, 0}, {0, -1, 0}), halves[1]);
}

// The sky is a cylinder of radius 0.7 * 50 * 1 m and the camera is 7 m above the floor, so a ray
// that falls by 0.2 s per metre meets the floor at 1 / s of that radius.
TEST(Shading, HazeIsWhereTheFloorMeetsTheSky) {
  TestRenderer s(
      std::string(R"(<statistic extent="1"/><visual><map haze=".3"/><rgba haze="0 0 1 1"/>
    <headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>)") +
      R"(<asset><texture name="sky" type="skybox" builtin="flat" rgb1="0 1 0" rgb2="0 1 0" width="8" height="48"/></asset>
    <worldbody><geom type="plane" size="0 0 1" rgba="1 0 0 1"/>
    <geom size="2" pos="0 23 2.4" rgba="1 1 1 1"/><geom size=".5" pos="-26 0 1.8" rgba="1 1 1 1"/><geom type="box" size="1 1 9" pos="40 0 9"/></worldbody>)");
  s.paint(0, [](int) { return Pixel{0, 255, 0}; });
  const auto falling = [&](double slope, double x, double y) {
    const double fall = 0.2 * slope, l = std::hypot(1, fall);
    return s.center({0, 0, 7}, {y, -x, 0}, {x * fall / l, y * fall / l, 1 / l}, 1);
  };
  const double inside = 255 * (1 - 1.2 / 1.36) * 1.3 / 0.3;
  expect_pixel(falling(2, 0, -1), {255, 0, 0});
  expect_pixel(falling(1.45, 0, -1), {255, 0, 0});
  expect_pixel(falling(1.2, 0, -1), {rounded(255 - inside), 0, rounded(inside)});
  expect_pixel(falling(1.0001, 0, -1), {0, 0, 255});
  const double outside = 255 * (0.5 / 1.15) / (1 - 0.3 / 1.3);
  expect_pixel(falling(0.5, 0, -1), {0, rounded(255 - outside), rounded(outside)});
  expect_pixel(falling(-0.1, 0, -1), {0, 255, 0});
  expect_pixel(falling(1, 0, 1), {255, 255, 255});   // a ball in front of the haze
  expect_pixel(falling(1, -1, 0), {255, 255, 255});  // another one, just nearer than the haze
  expect_pixel(falling(-0.1, 1, 0), {0, 255, 0});    // a box behind the sky
}

TEST(Shading, TransparentGeomsAreDrawnTwice) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<worldbody><geom type="plane" size="5 5 1" rgba="1 1 1 1"/>
    <geom type="box" size=".5 .5 .1" pos="0 0 .5" rgba="0 0 0 .5"/></worldbody>)");
  expect_pixel(s.from_above(0, 0), {64, 64, 64});  // 1 * (1 - .5)^2
}

TEST(Shading, FloorReflectsByItsReflectance) {
  TestRenderer s(
      std::string(kAmbient) +
      R"(<asset><material name="mirror" rgba="0 0 .2 1" reflectance=".5"/></asset><worldbody>
    <geom type="plane" size="5 5 1" material="mirror"/><geom type="box" size=".5 .1 .5" pos="0 1 1" rgba="1 0 0 1"/>
    </worldbody>)");
  s.options.reflections = true;
  // The ray from (0, -1, 1) goes down at 45 degrees. It meets the floor at the origin, where the
  // box's front is reflected at height 0.9.
  const double h = std::sqrt(0.5);
  expect_pixel(s.center({0, -1, 1}, {1, 0, 0}, {0, h, h}, 1), {128, 0, 51});
  expect_pixel(s.center({3, -1, 1}, {1, 0, 0}, {0, h, h}, 1), {0, 0, 51});
  s.options.reflections = false;
  expect_pixel(s.center({0, -1, 1}, {1, 0, 0}, {0, h, h}, 1), {0, 0, 51});
}

TEST(Kernels, EveryInstructionSetRendersTheSameImage) {
  TestRenderer s(
      R"(<asset><texture name="t" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="64" height="64"/>
    <texture name="q" type="cube" builtin="gradient" rgb1="1 1 0" rgb2="0 1 1" width="16" height="16"/>
    <material name="m" texture="t" texrepeat="3 3"/><material name="n" texture="q"/>
    <mesh name="tet" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
    <worldbody><light pos="1 1 4" dir="-.2 -.2 -1" castshadow="true"/><geom type="plane" size="0 0 .1" material="m"/>
    <geom type="box" size=".3 .2 .1" pos="0 0 1" euler="20 10 5" material="n"/><geom type="mesh" mesh="tet" pos=".5 .2 0"/>
    <geom type="ellipsoid" size=".3 .2 .1" pos="-.6 .3 .2" rgba=".9 .5 .1 .5"/>
    <geom type="capsule" size=".05 .3" pos="0 0 .3" rgba=".2 .9 .2 1"/>
    <geom type="cylinder" size=".1 .3" pos="-.3 -.6 .3" material="m"/></worldbody>)");
  s.options.shadows = true;
  const auto shoot = [&](RenderTiles render) {
    s.render = render;
    return s.shoot({0, -2.5, 1.5}, {1, 0, 0}, {0, 0.4, std::sqrt(1 - 0.16)}, 45);
  };
  const auto portable = shoot(render_tiles_portable);
  std::vector<RenderTiles> others;
  if constexpr (kHasAvx) {
    if (cpu_isa() >= Isa::kAvx2) others.push_back(render_tiles_avx2);
    if (cpu_isa() >= Isa::kAvx512) others.push_back(render_tiles_avx512);
  }
  for (RenderTiles render : others) {
    const auto image = shoot(render);
    int different = 0;
    for (std::size_t i = 0; i < image.size(); ++i)
      different += std::abs(image[i] - portable[i]) > 1;
    EXPECT_LT(different, 30);  // of 6075 values: edges that move by rounding
  }
}

TEST(Shading, SamplesSoftenEdges) {
  TestRenderer s(
      std::string(kAmbient) +
      R"(<worldbody><geom type="box" size=".5 .5 .5" rgba="1 1 1 1" euler="0 0 20"/></worldbody>)");
  const auto partly = [](const std::vector<std::uint8_t>& image) {
    int n = 0;
    for (auto v : image) n += v != 0 && v != 255;
    return n;
  };
  EXPECT_EQ(partly(s.shoot({0, 0, 3}, {1, 0, 0}, {0, 1, 0}, 40)), 0);
  EXPECT_GT(partly(s.shoot({0, 0, 3}, {1, 0, 0}, {0, 1, 0}, 40, 45, 4)), 100);
}

TEST(CameraModel, GridsFollowTheirFormulas) {
  const PixelGrid g = grid_from_fovy(8, 6, 90, false);
  EXPECT_FLOAT_EQ(g.left, -8.0f / 6);
  EXPECT_FLOAT_EQ(g.top, 1);
  EXPECT_FLOAT_EQ(g.dx, 2.0f / 6);
  EXPECT_FLOAT_EQ(g.dy, -2.0f / 6);
  const float focal[4] = {.006f, .006f, .0005f, -.0003f}, size[2] = {.008f, .006f};
  const PixelGrid p = grid_from_sensor(8, 6, focal, size);
  EXPECT_NEAR(p.left, -(.004 - .0005) / .006, 1e-6);
  EXPECT_NEAR(p.left + 8 * p.dx, (.004 + .0005) / .006, 1e-6);
  EXPECT_NEAR(p.top, (.003 + .0003) / .006, 1e-6);
  const PixelGrid k = grid_from_intrinsics(640, 480, 600, 610, 321, 238);
  const auto matrix = intrinsic_matrix(k);
  EXPECT_NEAR(matrix[0], 600, 1e-3);
  EXPECT_NEAR(matrix[4], 610, 1e-3);
  EXPECT_NEAR(matrix[2], 321, 1e-3);
  EXPECT_NEAR(matrix[5], 238, 1e-3);
}

TEST(CameraModel, DistortionIsUndone) {
  const PixelGrid grid = grid_from_intrinsics(64, 48, 60, 60, 32, 24);
  const double k[5] = {-0.2, 0.05, 0.001, -0.002, 0.01};
  const auto rays = distorted_rays(grid, Lens::kBrownConrady, k, "camera 'c'");
  for (int y = 0; y < 48; y += 7)
    for (int x = 0; x < 64; x += 7) {
      const double a = rays[2 * (64 * y + x)], b = -rays[2 * (64 * y + x) + 1], r2 = a * a + b * b;
      const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
      const double u = a * radial + 2 * k[2] * a * b + k[3] * (r2 + 2 * a * a);
      const double v = b * radial + k[2] * (r2 + 2 * b * b) + 2 * k[3] * a * b;
      EXPECT_NEAR(60 * u + 32, x + 0.5, 1e-4);
      EXPECT_NEAR(60 * v + 24, y + 0.5, 1e-4);
    }
  // An equidistant fisheye with a field of view of 139 degrees: the border pixel looks 69.5 degrees
  // off the axis.
  const double none[4] = {};
  const double f = 32 / (69.5 * M_PI / 180);
  const auto wide = distorted_rays(grid_from_intrinsics(64, 48, f, f, 32, 24), Lens::kFisheye, none,
                                   "camera 'c'");
  EXPECT_NEAR(std::atan(std::hypot(wide[2 * 64 * 24], wide[2 * 64 * 24 + 1])) * 180 / M_PI,
              69.5 * 31.504 / 32, 0.1);
  EXPECT_THROW(distorted_rays(grid_from_intrinsics(64, 48, 10, 10, 32, 24), Lens::kFisheye, none,
                              "camera 'c'"),
               ValueError);
}

// An image whose aspect ratio differs from the sensor's shows a part of the sensor, with square
// pixels if the sensor has square pixels.
TEST(Grid, ImageIsACropOfTheSensor) {
  const float focal[4] = {0.004f, 0.004f, 0, 0}, size[2] = {0.004f, 0.003f};
  const PixelGrid wide = grid_from_sensor(8, 4, focal, size);
  EXPECT_NEAR(8 * wide.dx, 1.0, 1e-6);
  EXPECT_NEAR(std::abs(wide.dy), wide.dx, 1e-6);
  const PixelGrid high = grid_from_sensor(4, 8, focal, size);
  EXPECT_NEAR(8 * std::abs(high.dy), 0.75, 1e-6);
  EXPECT_NEAR(high.dx, std::abs(high.dy), 1e-6);
}

}  // namespace
}  // namespace mjsense::render
