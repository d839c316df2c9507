// SPDX-License-Identifier: Apache-2.0
// Brightness by formula: Lambert's cosine, surfaces that face away from the light, emission, and
// shadows with known edges.

#include <gtest/gtest.h>

#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::expect_pixel;
using testing::kAmbient;
using testing::kDark;
using testing::kMatte;
using testing::Pixel;
using testing::TestRenderer;

int byte(double value) { return static_cast<int>(255 * std::clamp(value, 0.0, 1.0) + 0.5); }

//      \ light, 50 degrees from the vertical
//       \   _
//         /   \      Seen from straight above: at (x, y) the unit sphere's normal is
//        |     |     (x, y, sqrt(1 - x^2 - y^2)); the brightness is the cosine to the light.
//         \ _ /
TEST(Light, MatteSphereHasLambertsCosine) {
  TestRenderer s(std::string(kDark) +
                 R"(<asset><material name="m" specular="0" rgba="1 .5 .2 1"/></asset><worldbody>
    <light type="directional" dir=".766044443 0 -.642787610" diffuse="1 1 1" specular="0 0 0" castshadow="false"/>
    <geom size="1" material="m"/></worldbody>)");
  for (const auto& [x, y] : {std::pair{-0.7, 0.0},
                             {-0.5, 0.5},
                             {0.0, 0.0},
                             {0.0, -0.8},
                             {0.3, 0.2},
                             {0.6, 0.1},
                             {0.8, 0.0},
                             {0.95, 0.0}}) {
    const double z = std::sqrt(1 - x * x - y * y);
    // Negative where the surface faces away from the light.
    const double cosine = -0.766044443 * x + 0.642787610 * z;
    expect_pixel(s.center({x, y, 3}, {1, 0, 0}, {0, 1, 0}, 0.01),
                 {byte(cosine), byte(0.5 * cosine), byte(0.2 * cosine)});
  }
}

// A surface that faces away from the light has no highlight, wherever the viewer is.
TEST(Light, SurfaceFacingAwayHasNoHighlight) {
  const auto seen = [](double degrees) {
    const double a = degrees * M_PI / 180;
    TestRenderer s(
        std::string(kDark) +
        R"(<asset><material name="m" rgba="0 0 0 1" specular="1" shininess="0.0078125"/></asset>
      <worldbody><light type="directional" dir=")" +
        std::to_string(-std::sin(a)) + " 0 " + std::to_string(-std::cos(a)) +
        R"(" diffuse="1 1 1" specular="1 1 1" castshadow="false"/>
      <geom type="box" size="1 1 1" material="m"/></worldbody>)");
    return s.from_above(0, 0, 4)[0];
  };
  EXPECT_NEAR(seen(60), byte(std::cos(30 * M_PI / 180)),
              2);           // the half vector is 30 degrees off the normal; exponent 1
  EXPECT_EQ(seen(100), 0);  // without that rule it would be cos(50 degrees)
}

TEST(Light, EmissionNeedsNoLight) {
  TestRenderer s(
      std::string(kDark) +
      R"(<asset><material name="m" rgba="1 .5 .2 1" emission=".6" specular="0"/></asset><worldbody>
    <light pos="0 0 -5" dir="0 0 -1" castshadow="false"/>
    <geom type="plane" size="5 5 1" material="m"/></worldbody>)");
  expect_pixel(s.from_above(0, 0), {byte(.6), byte(.3), byte(.12)});
}

// MuJoCo's rule: a scene without any light gets an ambient light of 0.3.
TEST(Light, SceneWithoutLightsGetsAmbientLight) {
  TestRenderer s(std::string(kDark) +
                 R"(<worldbody><geom type="plane" size="5 5 1" rgba="1 .5 .2 1"/></worldbody>)");
  expect_pixel(s.from_above(0, 0), {byte(.3), byte(.15), byte(.06)});
}

// Contributions of several lights add up; the sum is clamped to white.
TEST(Light, TwoLightsAddUp) {
  TestRenderer s(std::string(kDark) +
                 R"(<asset><material name="m" specular="0" rgba="1 .5 .2 1"/></asset><worldbody>
    <light type="directional" dir="0 0 -1" diffuse=".4 .4 .4" specular="0 0 0" castshadow="false"/>
    <light type="directional" dir="0 -.6 -.8" diffuse=".5 .5 .5" specular="0 0 0" castshadow="false"/>
    <geom type="plane" size="5 5 1" material="m"/></worldbody>)");
  expect_pixel(s.from_above(0, 0), {byte(.8), byte(.4), byte(.16)});
}

//   light at z = 2 m
//        |         A box above the light casts no shadow,
//        |         a box between it and the floor does.
//   -----------
TEST(Shadow, IsCastByGeomsBetweenLightAndPoint) {
  for (const char* kind : {"spot", "directional"}) {
    TestRenderer s(std::string(kDark) + kMatte +
                   R"(<worldbody><light pos="0 0 2" dir="0 0 -1" type=")" + kind + R"(" cutoff="85"
      exponent="0" diffuse="1 1 1" specular="0 0 0"/><geom type="plane" size="5 5 1" material="matte"/>
      <geom type="box" size=".2 .2 .1" pos="0 0 2.2" material="matte"/>
      <geom type="box" size=".2 .2 .1" pos="1 0 .5" material="matte"/></worldbody>)");
    s.options.shadows = true;
    EXPECT_GT(s.from_above(0, 0, 1)[0], 200) << kind << ": the box above the light";
    // The same in an image that covers 2 m of floor, where the box is close to the region between
    // the light and the tile.
    const auto wide = s.shoot({0, 0, 1}, {1, 0, 0}, {0, 1, 0}, 16, 90);
    EXPECT_GT(wide[3 * (8 * 16 + 8)], 200) << kind;
    // The spot at height 2 projects the box's shadow to 1 + (0.4 .. 0.6) / (2 - z).
    const double x = std::string(kind) == "spot" ? 1.35 : 1.0;
    const Pixel below = s.center({x, 0, 0.3}, {1, 0, 0}, {0, 1, 0}, 1);
    EXPECT_EQ(below[0], 0) << kind << ": the box below the light";
  }
}

//   \    \      Directional light at 45 degrees: a box with x in [-.1, .1] and z in [.4, .6]
//    \ [] \     shadows the floor from x = -.1 + .4 to .1 + .6.
//   ---====---
TEST(Shadow, OfSlantedDirectionalLight) {
  for (const char* shape : {"type='box' size='.1 .3 .1'", "type='mesh' mesh='block'"}) {
    TestRenderer s(std::string(kDark) + kMatte +
                   R"(<asset><mesh name="block" vertex="-.1 -.3 -.1 .1 -.3 -.1 -.1 .3 -.1 .1 .3 -.1
      -.1 -.3 .1 .1 -.3 .1 -.1 .3 .1 .1 .3 .1"/></asset><worldbody>
      <light type="directional" pos="-3 0 3" dir="1 0 -1" diffuse="1 1 1" specular="0 0 0"/>
      <geom type="plane" size="5 5 1" material="matte"/><geom pos="0 0 .5" material="matte" )" +
                   shape + "/></worldbody>");
    s.options.shadows = true;
    const auto lit = [&](double x, double y) {
      return s.center({x, y, 0.2}, {1, 0, 0}, {0, 1, 0}, 0.1)[0] > 100;
    };
    EXPECT_TRUE(lit(0.28, 0)) << shape;
    EXPECT_FALSE(lit(0.32, 0)) << shape;
    EXPECT_FALSE(lit(0.68, 0)) << shape;
    EXPECT_TRUE(lit(0.72, 0)) << shape;
    EXPECT_FALSE(lit(0.5, 0.29)) << shape;
    EXPECT_TRUE(lit(0.5, 0.31)) << shape;
    EXPECT_TRUE(lit(-0.5, 0)) << shape;
  }
}

//      |  \    Directional light at 45 degrees: the upright part of a mesh, 0.5 m high, shadows the
//  ====|====   level part of the same mesh from x = .2 - .5 on.
TEST(Shadow, OfAMeshOnItself) {
  std::string vertices, faces;
  const auto add_box = [&](const std::array<double, 6>& limits, int first) {
    for (int corner = 0; corner < 8; ++corner)
      for (int i = 0; i < 3; ++i)
        vertices += std::to_string(limits[2 * i + (corner >> i & 1)]) + " ";
    for (const auto& [a, b, c] : std::array<std::array<int, 3>, 12>{{{0, 2, 1},
                                                                     {1, 2, 3},
                                                                     {4, 5, 6},
                                                                     {5, 7, 6},
                                                                     {0, 1, 4},
                                                                     {1, 5, 4},
                                                                     {2, 6, 3},
                                                                     {3, 6, 7},
                                                                     {0, 4, 2},
                                                                     {2, 4, 6},
                                                                     {1, 3, 5},
                                                                     {3, 7, 5}}})
      faces += std::to_string(first + a) + " " + std::to_string(first + b) + " " +
               std::to_string(first + c) + " ";
  };
  add_box({-1, 1, -1, 1, -0.1, 0}, 0);
  add_box({0.2, 0.3, -1, 1, 0, 0.5}, 8);
  // MuJoCo chooses the origin of the mesh's frame; the geom is placed so that the vertices keep
  // their positions.
  TestRenderer s(std::string(kDark) + kMatte + "<asset><mesh name='step' inertia='shell' vertex='" +
                 vertices + "' face='" + faces + R"('/></asset><worldbody>
    <light type="directional" pos="3 0 3" dir="-1 0 -1" diffuse="1 1 1" specular="0 0 0"/>
    <geom type="mesh" mesh="step" material="matte"/></worldbody>)");
  s.options.shadows = true;
  const auto lit = [&](double x) { return s.center({x, 0, 1}, {1, 0, 0}, {0, 1, 0}, 1)[0] > 100; };
  EXPECT_TRUE(lit(-0.32));
  EXPECT_FALSE(lit(-0.28));
  EXPECT_FALSE(lit(0.18));
  EXPECT_TRUE(lit(0.25));
}

// A shadow removes only the light that casts it.
TEST(Shadow, DoesNotAffectOtherLights) {
  TestRenderer s(std::string(kDark) + kMatte + R"(<worldbody>
    <light type="directional" pos="0 0 3" dir="0 0 -1" diffuse=".5 .5 .5" specular="0 0 0"/>
    <light type="directional" pos="3 0 3" dir="-1 0 -1" diffuse=".5 .5 .5" specular="0 0 0"/>
    <geom type="plane" size="5 5 1" material="matte"/><geom type="box" size=".2 .2 .05" pos="0 0 1" material="matte"/>
    </worldbody>)");
  s.options.shadows = true;
  const double slanted = 0.5 * std::sqrt(0.5);
  const auto floor = [&](double x) { return s.center({x, 0, 0.3}, {1, 0, 0}, {0, 1, 0}, 1)[0]; };
  EXPECT_NEAR(floor(0), byte(slanted), 1);  // below the box: only the second light
  EXPECT_NEAR(floor(-1), byte(0.5), 1);     // in the second light's shadow: only the first light
  EXPECT_NEAR(floor(1), byte(0.5 + slanted), 1);  // both lights
}

}  // namespace
}  // namespace mjsense::render
