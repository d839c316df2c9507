// SPDX-License-Identifier: Apache-2.0
// The appearance of surfaces: texels by position on a shape, triangle meshes compared with
// primitives of the same outline, transparency, reflections, and geoms that are partly outside the
// image.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mjsense/render/testing/test_renderer.h"
#include "mjsense/render/view/fixed_layer.h"

namespace mjsense::render {
namespace {

using testing::expect_pixel;
using testing::kAmbient;
using testing::kDark;
using testing::kMatte;
using testing::Picture;
using testing::Pixel;
using testing::TestRenderer;

constexpr Pixel kRed{255, 0, 0}, kGreen{0, 255, 0}, kBlue{0, 0, 255}, kWhite{255, 255, 255};

// A texture with four quadrants: red and green above, blue and white below.
std::string painted(const char* geoms, const char* material = "") {
  return std::string(kAmbient) +
         R"(<asset><texture name="t" type="2d" builtin="flat" width="32" height="32"/>
    <material name="m" texture="t" )" +
         material + R"(/></asset><worldbody>)" + geoms + "</worldbody>";
}

constexpr Pixel kFields[] = {kRed, kGreen, kBlue, kWhite};

void paint(TestRenderer& s, const Pixel* fields = kFields, int size = 32) {
  s.paint(0, [&](int i) { return fields[2 * (i / size >= size / 2) + (i % size >= size / 2)]; });
}

// Seen from the side, the first row of a texture is at the top of every closed shape.
TEST(Texture, IsUprightOnEveryShape) {
  for (const char* shape :
       {"type='box' size='.5 .5 .5'", "type='sphere' size='.5'", "type='ellipsoid' size='.4 .5 .6'",
        "type='cylinder' size='.4 .5'", "type='capsule' size='.3 .5'"}) {
    TestRenderer s(painted((std::string("<geom ") + shape + " material='m'/>").c_str()));
    paint(s);
    const auto from_side = [&](double y, double z) {
      return s.center({2, y, z}, {0, 1, 0}, {0, 0, 1}, 0.1);
    };
    for (const double y : {-0.15, 0.15}) {
      const Pixel up = from_side(y, 0.25), down = from_side(y, -0.25);
      EXPECT_TRUE(up == kRed || up == kGreen) << shape << " " << up[0] << up[1] << up[2];
      EXPECT_TRUE(down == kBlue || down == kWhite) << shape << " " << down[0] << down[1] << down[2];
      EXPECT_EQ(up == kRed, down == kBlue) << shape;
    }
  }
}

// On a sphere the texture starts at the +x axis and runs towards +y: its left half is at y > 0.
TEST(Texture, GoesAroundASphereFromXToY) {
  TestRenderer s(painted("<geom size='.5' material='m'/>"));
  paint(s);
  for (const double angle : {0.25, 0.5, 0.75, 1.25, 1.5, 1.75}) {  // in units of pi
    const double c = std::cos(angle * M_PI), t = std::sin(angle * M_PI);
    const Pixel got = s.center({2 * c, 2 * t, 0.1}, {-t, c, 0}, {0, 0, 1}, 0.1);
    if (angle == 0.5) expect_pixel(got, kRed);
    if (angle == 1.5) expect_pixel(got, kGreen);
    EXPECT_GT(angle < 1 ? got[0] : got[1], angle < 1 ? got[1] : got[0]) << angle;
  }
}

// The texture covers a capsule from pole to pole: its first row is at the upper pole, its last at
// the lower.
TEST(Texture, CoversACapsuleFromPoleToPole) {
  TestRenderer s(painted("<geom type='capsule' size='.5 .3' material='m'/>"));
  constexpr Pixel kRows[] = {kRed, kRed, kBlue, kBlue};
  paint(s, kRows);
  expect_pixel(s.from_above(0.05, 0.05), kRed);
  expect_pixel(s.center({0.05, 0.05, -2}, {1, 0, 0}, {0, -1, 0}, 0.1), kBlue);
}

// Each end of a cylinder shows the whole texture, projected along the axis.
TEST(Texture, IsProjectedOntoTheEndsOfACylinder) {
  TestRenderer s(painted("<geom type='cylinder' size='.5 .3' material='m'/>"));
  paint(s);
  expect_pixel(s.from_above(-0.25, -0.25), kRed);
  expect_pixel(s.from_above(0.25, -0.25), kGreen);
  expect_pixel(s.from_above(-0.25, 0.25), kBlue);
  expect_pixel(s.from_above(0.25, 0.25), kWhite);
}

TEST(Texture, FirstRowIsAtPlusYOnTopOfABox) {
  TestRenderer s(painted("<geom type='box' size='.5 .4 .3' material='m'/>"));
  paint(s);
  expect_pixel(s.from_above(-0.25, 0.2), kRed);
  expect_pixel(s.from_above(0.25, 0.2), kGreen);
  expect_pixel(s.from_above(-0.25, -0.2), kBlue);
  expect_pixel(s.from_above(0.25, -0.2), kWhite);
}

// A mesh uses the texture coordinates of its corners. u points right; the direction of v is
// MuJoCo's choice.
TEST(Texture, UsesTheTexcoordsOfAMesh) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<asset><texture name="t" type="2d" builtin="flat" width="2" height="2"/>
    <material name="m" texture="t"/><mesh name="sheet" inertia="shell" vertex="-1 -1 0 1 -1 0 1 1 0 -1 1 0"
    texcoord="0 1 1 1 1 0 0 0" face="0 1 2 0 2 3"/></asset><worldbody><geom type="mesh" mesh="sheet" material="m" contype="0" conaffinity="0"/></worldbody>)");
  paint(s, kFields, 2);
  // Large in the image and small in it: rasterised and ray cast.
  for (const double height : {0.9, 30.0}) {
    const double fovy = height < 1 ? 60 : 0.5;
    const auto texel = [&](double x, double y) {
      return s.center({x, y, height}, {1, 0, 0}, {0, 1, 0}, fovy);
    };
    expect_pixel(texel(-0.5, 0.5), kRed);
    expect_pixel(texel(0.5, 0.5), kGreen);
    expect_pixel(texel(-0.5, -0.5), kBlue);
    expect_pixel(texel(0.5, -0.5), kWhite);
    // A quarter of the distance from one texel's centre to the next.
    expect_pixel(texel(-0.25, 0.5), {191, 64, 0}, 2);
    expect_pixel(texel(-0.5, 0.25), {191, 0, 64}, 2);
  }
}

// A pixel shows the mean of a texture that is finer than the pixels.
TEST(Texture, IsFilteredIfFinerThanPixels) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<asset><texture name="t" type="2d" builtin="flat" width="64" height="64"/>
    <material name="m" texture="t" texrepeat="40 40"/></asset><worldbody><geom type="plane" size="5 5 1" material="m"/></worldbody>)");
  s.paint(0, [](int i) { return (i % 64 + i / 64) % 2 ? kWhite : Pixel{0, 0, 0}; });
  const auto image = s.shoot({0.03, 0.02, 5}, {1, 0, 0}, {0, 1, 0}, 24, 60);
  for (const std::uint8_t v : image) EXPECT_NEAR(v, 128, 8);
}

// With texuniform a texture has the same size in metres on shapes of any size.
TEST(Texture, UniformRepeatIsPerMetre) {
  const auto borders_per_metre = [](const char* size, const char* material) {
    TestRenderer s(painted(
        (std::string("<geom type='plane' material='m' size='") + size + "'/>").c_str(), material));
    constexpr Pixel kColumns[] = {kWhite, {0, 0, 0}, kWhite, {0, 0, 0}};
    paint(s, kColumns);
    // A row of 400 pixels over 4 m, i.e. 1 cm each, near the middle of both planes.
    const Picture p =
        s.take({0.003, 0.003, 10}, {1, 0, 0}, {0, 1, 0}, grid_from_fovy(400, 1, 0.01, true));
    int borders = 0;
    for (int x = 1; x < 400; ++x) borders += (p.at(x, 0)[0] > 128) != (p.at(x - 1, 0)[0] > 128);
    return borders / 4.0;
  };
  const char* uniform = "texuniform='true' texrepeat='3 3'";
  EXPECT_NEAR(borders_per_metre("2 2 1", uniform), borders_per_metre("4 4 1", uniform), 0.3);
  EXPECT_NEAR(borders_per_metre("2 2 1", "texrepeat='3 3'"),
              2 * borders_per_metre("4 4 1", "texrepeat='3 3'"), 0.3);
}

// A mesh of twelve triangles looks like the box with the same corners: same pixels, depth and
// normals.
TEST(Triangles, OfABoxRenderLikeTheBox) {
  const std::string mesh =
      R"(<asset><mesh name="block" vertex="-.3 -.2 -.1 .3 -.2 -.1 -.3 .2 -.1 .3 .2 -.1
    -.3 -.2 .1 .3 -.2 .1 -.3 .2 .1 .3 .2 .1"/></asset>)";
  for (const char* pose :
       {"euler='0 0 0'", "euler='20 35 50'", "euler='-70 15 5' pos='.2 .1 .3'"}) {
    for (const double distance :
         {0.7, 1.5, 9.0}) {  // larger than the image, inside it, and a few pixels
      const auto see = [&](const char* shape) {
        TestRenderer s(std::string(kAmbient) + mesh + "<worldbody><geom rgba='1 .5 .2 1' " + shape +
                       " " + pose + "/></worldbody>");
        return s.take({0.1, -distance, 0.1}, {1, 0, 0}, {0, 0, 1},
                      grid_from_fovy(80, 60, 50, false));
      };
      const Picture box = see("type='box' size='.3 .2 .1'"),
                    drawn = see("type='mesh' mesh='block'");
      int seen = 0, different = 0;
      for (int i = 0; i < 80 * 60; ++i) {
        const bool a = box.ids[2 * i] >= 0, b = drawn.ids[2 * i] >= 0;
        seen += a;
        if (a != b) {
          ++different;
          continue;
        }
        if (!a) continue;
        EXPECT_NEAR(box.depth[i], drawn.depth[i], 2e-5 * distance);
        const double turned = std::abs(box.normals[3 * i] - drawn.normals[3 * i]) +
                              std::abs(box.normals[3 * i + 1] - drawn.normals[3 * i + 1]) +
                              std::abs(box.normals[3 * i + 2] - drawn.normals[3 * i + 2]);
        different += turned > 1e-3;  // at an edge rounding may choose the other face
      }
      EXPECT_GE(seen, 4) << pose << " " << distance;
      EXPECT_LE(different, std::max(2, seen / 100)) << pose << " " << distance;
    }
  }
}

// The front of an open sheet is where its corners are counterclockwise. From behind it is
// invisible.
TEST(Triangles, AreVisibleFromTheFrontOnly) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<asset><mesh name="sheet" inertia="shell" vertex="-1 -1 0 1 -1 0 1 1 0 -1 1 0"
    face="0 1 2 0 2 3"/></asset><worldbody><geom type="mesh" mesh="sheet" rgba="1 1 1 1" contype="0" conaffinity="0"/></worldbody>)");
  for (const double height : {0.5, 40.0}) {
    const double fovy = height < 1 ? 60 : 5;
    const Picture above =
        s.take({0, 0, height}, {1, 0, 0}, {0, 1, 0}, grid_from_fovy(32, 32, fovy, false));
    const Picture below =
        s.take({0, 0, -height}, {1, 0, 0}, {0, -1, 0}, grid_from_fovy(32, 32, fovy, false));
    EXPECT_EQ(above.id(16, 16), 0) << height;
    EXPECT_EQ(below.id(16, 16), -1) << height;
    // Half size of the sheet's outline: half its width over the distance.
    const int reach = static_cast<int>(16 * (1 / height) / std::tan(fovy * M_PI / 360));
    if (reach < 14) {
      EXPECT_EQ(above.id(16 + reach - 1, 16), 0);
      EXPECT_EQ(above.id(16 + reach + 1, 16), -1);
      EXPECT_EQ(above.id(16, 16 - reach - 2), -1);
    }
  }
}

TEST(Surface, HigherIdWinsIfSurfacesCoincide) {
  for (const char* shape : {"type='box' size='.3 .3 .3'", "type='mesh' mesh='block'"}) {
    TestRenderer s(std::string(kAmbient) +
                   R"(<asset><mesh name="block" vertex="-.3 -.3 -.3 .3 -.3 -.3 -.3 .3 -.3 .3 .3 -.3
      -.3 -.3 .3 .3 -.3 .3 -.3 .3 .3 .3 .3 .3"/></asset><worldbody><geom rgba="1 0 0 1" )" +
                   shape + "/><geom rgba='0 0 1 1' " + shape + "/></worldbody>");
    expect_pixel(s.center({0.05, 0.1, 1}, {1, 0, 0}, {0, 1, 0}), kBlue);
  }
}

// A geom's own colour, unless it is the default, takes precedence over its material's.
TEST(Surface, OwnColourOverridesTheMaterials) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<asset><material name="m" rgba="0 0 1 1"/></asset><worldbody>
    <geom type="box" size=".1 .1 .1" pos="-1 0 0" material="m"/><geom type="box" size=".1 .1 .1" pos="0 0 0" material="m" rgba="1 0 0 1"/>
    <geom type="box" size=".1 .1 .1" pos="1 0 0" rgba="0 1 0 1"/></worldbody>)");
  expect_pixel(s.from_above(-1, 0), kBlue);
  expect_pixel(s.from_above(0, 0), kRed);
  expect_pixel(s.from_above(1, 0), kGreen);
}

// From below a plane is drawn as a veil of alpha 0.3, blended twice: its weight is 1 - 0.7^2.
TEST(Surface, PlaneFromBelowIsTranslucent) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<worldbody><geom type="plane" size="5 5 1" rgba="1 1 1 1"/>
    <geom size=".5" pos="2 0 2" rgba="0 0 1 1"/></worldbody>)");
  const int veil = static_cast<int>(std::lround(255 * (1 - 0.7 * 0.7)));
  const auto up = [&](double x) { return s.center({x, 0, -2}, {1, 0, 0}, {0, -1, 0}, 1); };
  expect_pixel(up(0), {veil, veil, veil});
  expect_pixel(up(2), {veil, veil, 255}, 2);  // the ball behind it is visible through the veil
}

// Only the top of a box reflects, not its sides.
TEST(Surface, OnlyTheTopOfABoxReflects) {
  TestRenderer s(
      std::string(kAmbient) +
      R"(<asset><material name="mirror" rgba="0 0 .2 1" reflectance=".5"/></asset><worldbody>
    <geom type="box" size="1 1 .5" pos="0 0 -.5" material="mirror"/>
    <geom type="box" size="9 .1 9" pos="0 3 0" rgba="1 0 0 1"/><geom type="box" size="9 .1 9" pos="0 -30 0" rgba="0 1 0 1"/>
    </worldbody>)");
  s.options.reflections = true;
  const double h = std::sqrt(0.5);
  expect_pixel(s.center({0, -1.5, 1.5}, {1, 0, 0}, {0, h, h}, 1),
               {128, 0, 51});  // the red wall, reflected in the top
  const double n = std::hypot(2, 0.7);
  expect_pixel(s.center({0, -3, 0.5}, {1, 0, 0}, {0, 0.7 / n, 2 / n}, 1), {0, 0, 51});  // the front
}

// A mirrored camera has a left-handed frame, in which the corners of triangles run the other way.
TEST(Surface, AMirrorShowsTheFrontsOfAMesh) {
  const auto shoot = [](const std::string& block) {
    TestRenderer s(std::string(kDark) +
                   R"(<asset><material name="mirror" rgba="0 0 0 1" reflectance="1"/>
      <mesh name="block" vertex="-.3 -.2 -.1 .3 -.2 -.1 -.3 .2 -.1 .3 .2 -.1
      -.3 -.2 .1 .3 -.2 .1 -.3 .2 .1 .3 .2 .1"/></asset><worldbody>
      <light pos="1 -4 1" dir="-.2 1 -.1" type="directional" diffuse="1 1 1" ambient=".2 .2 .2"/>
      <geom type="plane" size="5 5 1" material="mirror"/><geom pos="0 1 1" euler="20 30 10" )" +
                   block + "/></worldbody>");
    s.options.reflections = true;
    const double h = std::sqrt(0.5);
    return s.shoot({0, -1, 1}, {1, 0, 0}, {0, h, h}, 64, 30);  // down at 45 degrees
  };
  const auto box = shoot("type='box' size='.3 .2 .1'"), mesh = shoot("type='mesh' mesh='block'");
  int shown = 0, different = 0;
  for (std::size_t i = 0; i < box.size(); ++i) {
    shown += box[i] > 0;
    different += std::abs(box[i] - mesh[i]) > 2;
  }
  EXPECT_GT(shown, 1000);
  EXPECT_LT(different, 30);  // edges that move by rounding
}

// As in OpenGL, multisampling changes edges only, also in a mirror: its texture is not averaged.
TEST(Surface, MultisamplingChangesOnlyTheEdgesInAMirror) {
  TestRenderer s(
      std::string(kAmbient) +
      R"(<asset><texture name="t" type="2d" builtin="checker" rgb1="0 0 0" rgb2="0 1 0" width="64" height="64"/>
    <material name="mirror" texture="t" texrepeat="40 40" reflectance=".5"/></asset><worldbody>
    <geom type="plane" size="5 5 1" material="mirror"/>
    <geom type="box" size="2 .1 9" pos="2 3 0" rgba="1 0 0 1"/></worldbody>)");
  s.options.reflections = true;
  s.update();
  ViewBuilder builder(s.model.get(), *s.assets, s.options);
  const double h = std::sqrt(0.5);
  PixelGrid grid = grid_from_fovy(64, 64, 30, false);
  grid.left -= 4.25f * grid.dx;  // the wall's edge goes through column 35
  const View& view = s.view(builder, {0, -1, 1}, {1, 0, 0}, {0, h, h}, grid);
  const auto shoot = [&](bool multisampled) {
    std::vector<std::uint8_t> rgb(3 * 64 * 64);
    ImageTargets targets;
    targets.rgb = rgb.data();
    targets.samples = multisampled ? 4 : 1;
    targets.multisampled = multisampled;
    s.draw(view, targets);
    return rgb;
  };
  const auto plain = shoot(false), smooth = shoot(true);
  // The left half shows the checker, the right half also the red wall.
  int softened = 0;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const int at = 3 * (64 * y + x);
      if (x == 35 || x == 36) {
        softened += smooth[at] != plain[at];
        continue;
      }
      for (int c = 0; c < 3; ++c) ASSERT_EQ(smooth[at + c], plain[at + c]) << x << " " << y;
    }
  }
  EXPECT_GT(softened, 0);
}

// The four rays of a pixel have four different heights, so an edge along the rows is softened too.
TEST(Surface, SamplesSoftenEdgesInBothDirections) {
  TestRenderer s(std::string(kAmbient) +
                 R"(<worldbody><geom type="box" size=".5 .5 .5" rgba="1 1 1 1"/></worldbody>)");
  // 8 pixels over 2 m, orthographic, from 10 m above: pixels of 0.25 m, the box's edge at 0.5 m.
  // After a shift by a quarter of a pixel, the pixels along the edge are covered by a quarter.
  for (const bool rows : {false, true}) {
    const double shift = 0.0625;
    const Picture p = s.take({rows ? 0 : shift, rows ? shift : 0, 10}, {1, 0, 0}, {0, 1, 0},
                             grid_from_fovy(8, 8, 2, true), 4);
    const auto value = [&](int across) {
      return rows ? p.at(4, 7 - across)[0] : p.at(across, 4)[0];
    };
    EXPECT_EQ(value(0), 0);
    EXPECT_NEAR(value(1), 64, 1) << rows;  // from -0.6875 to -0.4375: a quarter
    EXPECT_EQ(value(2), 255);
    EXPECT_NEAR(value(5), 191, 1) << rows;  // from 0.3125 to 0.5625: three quarters
    EXPECT_EQ(value(6), 0);
  }
}

// =======[camera]==========> A beam from behind the camera to far ahead.
TEST(Window, GeomReachingBehindTheCameraIsFullyVisible) {
  for (const char* shape :
       {"type='box' size='.1 20 .1'", "type='capsule' size='.1 20' euler='90 0 0'",
        "type='mesh' mesh='beam'"}) {
    TestRenderer s(std::string(kAmbient) +
                   R"(<asset><mesh name="beam" vertex="-.1 -20 -.1 .1 -20 -.1 -.1 20 -.1 .1 20 -.1
      -.1 -20 .1 .1 -20 .1 -.1 20 .1 .1 20 .1"/></asset><worldbody><geom pos=".5 0 0" rgba="1 1 1 1" )" +
                   shape + "/></worldbody>");
    const Picture p = s.take({0, 0, 0}, {1, 0, 0}, {0, 0, 1}, grid_from_fovy(64, 64, 90, false));
    // The beam's near side is at x = 0.4: it fills the row of the horizon from 0.4 / 20 to the
    // right border.
    for (const int x : {36, 45, 55, 63}) EXPECT_EQ(p.id(x, 32), 0) << shape << " " << x;
    for (const int x : {0, 20, 31}) EXPECT_EQ(p.id(x, 32), -1) << shape << " " << x;
    EXPECT_EQ(p.id(40, 5), -1) << shape;
  }
}

// An orthographic camera shows an object at the same position and size at any distance.
TEST(Window, OrthographicSizeIsIndependentOfDistance) {
  for (const double distance : {2.0, 8.0, 200.0}) {
    TestRenderer s(
        std::string(kAmbient) +
        R"(<worldbody><geom type="box" size=".3 .2 .1" pos=".5 .4 0" rgba="1 1 1 1"/></worldbody>)");
    const Picture p =
        s.take({0, 0, distance}, {1, 0, 0}, {0, 1, 0}, grid_from_fovy(40, 40, 2, true));
    // Pixels of 5 cm: columns 20 + 4 to 20 + 16, rows 20 - 12 to 20 - 4.
    int count = 0;
    for (int y = 0; y < 40; ++y)
      for (int x = 0; x < 40; ++x) {
        const bool inside = x >= 24 && x < 36 && y >= 8 && y < 16;
        EXPECT_EQ(p.id(x, y), inside ? 0 : -1) << distance << ": " << x << " " << y;
        count += p.id(x, y) == 0;
      }
    EXPECT_EQ(count, 12 * 8);
  }
}

// The layer of fixed geoms is reused. Moving geoms and their shadows are drawn over it; if any
// fixed geom or light changes, the layer is no longer used.
TEST(FixedLayer, IsUsedWhileItsInputsAreUnchanged) {
  TestRenderer s(std::string(kDark) + kMatte + R"(<worldbody>
    <light pos="0 0 3" dir="0 0 -1" cutoff="80" exponent="0" diffuse="1 1 1" specular="0 0 0"/>
    <geom type="plane" size="5 5 1" material="matte"/><geom name="fixed" type="box" size=".2 .2 .1" pos=".6 0 .1" material="matte"/>
    <body mocap="true" pos="-.6 0 0"><geom type="box" size=".2 .2 .1" material="matte"/><body/></body>
    <body pos="0 0 9"><freejoint/><geom name="moving" size=".2" material="matte"/></body>
    <camera pos="0 0 4"/></worldbody>)");
  ASSERT_TRUE(FixedLayer::possible(s.model.get(), 0));
  s.options.shadows = s.options.layered = true;
  s.update();
  constexpr int kSize = 64;
  const PixelGrid grid = grid_from_fovy(kSize, kSize, 50, false);
  ViewBuilder builder(s.model.get(), *s.assets, s.options);
  FixedLayer layer(s.model.get(), kSize, kSize);
  const double h = std::sqrt(0.5);
  const auto build = [&]() -> const View& {  // at 45 degrees, looking at the middle of the floor
    return s.view(builder, {0, -2, 2}, {1, 0, 0}, {0, h, h}, grid);
  };
  const auto image = [&](bool kept) {
    Picture p(kSize, kSize);
    const View& view = build();
    if (kept) builder.use_fixed(layer.tiles());
    s.draw(view, p.targets());
    return p;
  };
  EXPECT_FALSE(layer.settles(build()));  // seen for the first time
  EXPECT_TRUE(layer.settles(build()));   // seen again, unchanged
  ImageTargets tiles;
  tiles.fixed_tiles = layer.tiles();
  s.draw(build(), tiles);
  EXPECT_TRUE(layer.shows(build()));
  EXPECT_EQ(image(true).rgb, image(false).rgb);

  // A ball between the light and the floor: visible in the image, with its shadow around it.
  const Picture empty = image(true);
  s.data->qpos[0] = 0;
  s.data->qpos[2] = 1.5;
  s.update();
  ASSERT_TRUE(layer.shows(build()));
  const Picture with_ball = image(true);
  EXPECT_EQ(with_ball.rgb, image(false).rgb);
  // Its shadow has a radius of 0.2 / sqrt(1.5^2 - 0.2^2) * 3 = 0.40 m around the middle of the
  // floor.
  EXPECT_EQ(with_ball.id(32, 32), 0);
  EXPECT_EQ(with_ball.at(32, 32)[0], 0);
  EXPECT_GT(empty.at(32, 32)[0], 100);

  // If a fixed geom moves or changes its size or colour, or a light changes, the layer does not
  // apply.
  const auto changes = [&](auto&& change, auto&& back) {
    change();
    s.update();
    const bool shown = layer.shows(build());
    back();
    s.update();
    return !shown && layer.shows(build());
  };
  EXPECT_TRUE(changes([&] { s.data->mocap_pos[0] += 0.01; }, [&] { s.data->mocap_pos[0] = -0.6; }));
  const int fixed = mj_name2id(s.model.get(), mjOBJ_GEOM, "fixed");
  float* rgba = s.model->geom_rgba + 4 * fixed;
  const float was = rgba[1];
  EXPECT_TRUE(changes([&] { rgba[1] = 0.123f; }, [&] { rgba[1] = was; }));
  double* size = s.model->geom_size + 3 * fixed;
  EXPECT_TRUE(changes([&] { size[2] = 0.3; }, [&] { size[2] = 0.1; }));
  EXPECT_TRUE(
      changes([&] { s.model->light_diffuse[0] = 0.5f; }, [&] { s.model->light_diffuse[0] = 1; }));
}

// One common layer serves all worlds that look the same. The first worlds also have layers of their
// own, up to the memory limit.
TEST(FixedLayer, WorldsThatLookTheSameShareALayer) {
  TestRenderer s(std::string(kDark) + kMatte + R"(<worldbody><light pos="0 0 3" dir="0 0 -1"/>
    <geom type="plane" size="5 5 1" material="matte"/><camera pos="0 0 4"/></worldbody>)");
  s.options.shadows = s.options.layered = true;
  s.update();
  constexpr int kSize = 64;
  const PixelGrid grid = grid_from_fovy(kSize, kSize, 50, false);
  ViewBuilder builder(s.model.get(), *s.assets, s.options);
  const auto view_of = [&](float red) -> const View& {
    s.model->geom_rgba[0] = red;
    s.update();
    return s.view(builder, {0, -2, 2}, {1, 0, 0}, {0, 1, 1}, grid);
  };
  FixedLayers layers(s.model.get(), kSize, kSize, 8, 2 * FixedLayer::bytes(kSize, kSize));
  // If worlds look the same, one layer is rendered for all.
  EXPECT_EQ(layers.settle_common(0, view_of(1)), nullptr);
  EXPECT_EQ(layers.find(5, view_of(1)), nullptr);
  const FixedTile* common = layers.settle_common(0, view_of(1));
  ASSERT_NE(common, nullptr);
  for (int world : {0, 1, 5}) EXPECT_EQ(layers.find(world, view_of(1)), common);
  // World 1 and world 5 change; world 5 has no layer of its own.
  EXPECT_EQ(layers.find(1, view_of(0.5f)), nullptr);
  EXPECT_EQ(layers.settle(1, view_of(0.5f)), nullptr);
  const FixedTile* own = layers.settle(1, view_of(0.5f));
  ASSERT_NE(own, nullptr);
  EXPECT_NE(own, common);
  EXPECT_EQ(layers.find(1, view_of(0.5f)), own);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(layers.settle(5, view_of(0.5f)), nullptr);
  EXPECT_EQ(layers.find(5, view_of(0.5f)), nullptr);
  // A world with its own layer does not replace the common one.
  EXPECT_EQ(layers.settle_common(1, view_of(0.5f)), nullptr);
  EXPECT_EQ(layers.find(0, view_of(1)), common);
}

TEST(FixedLayer, NeedsAFixedCameraAndFixedLights) {
  const auto possible = [](const char* world) {
    TestRenderer s(std::string("<worldbody><geom type='plane' size='1 1 1'/>") + world +
                   "</worldbody>");
    return FixedLayer::possible(s.model.get(), 0);
  };
  EXPECT_TRUE(possible("<light pos='0 0 2'/><camera/>"));
  EXPECT_TRUE(possible("<camera/>"));
  EXPECT_TRUE(possible("<light pos='0 0 2' castshadow='false'/><camera/>"));
  EXPECT_FALSE(
      possible("<camera/><body><joint/><geom size='.1'/><light castshadow='false'/></body>"));
  EXPECT_FALSE(possible("<light pos='0 0 2'/><body><joint/><geom size='.1'/><camera/></body>"));
  EXPECT_FALSE(possible("<camera/><body><joint/><geom size='.1'/><light/></body>"));
  EXPECT_FALSE(
      possible("<light pos='0 0 2'/><camera/><body><joint/><geom size='.1'/><light/></body>"));
  EXPECT_FALSE(possible("<light mode='trackcom' pos='0 0 2'/><camera/>"));
  EXPECT_FALSE(possible("<light pos='0 0 2'/><camera mode='trackcom'/>"));
  EXPECT_TRUE(
      possible("<light pos='0 0 2'/><body mocap='true'><geom size='.1'/><camera/><body/></body>"));
  EXPECT_FALSE(
      possible("<light pos='0 0 2'/><body mocap='true'><geom size='.1'/><camera/></body>"));
}

}  // namespace
}  // namespace mjsense::render
