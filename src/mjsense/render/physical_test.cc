// SPDX-License-Identifier: Apache-2.0
// Physically based images of scenes whose radiance is known: a white sphere in a white room, Lambert's
// cosine, the inverse-square law. Other outputs are those of classic images.

#include <gtest/gtest.h>

#include <cmath>

#include "mjsense/core/system/cpu.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::kDark;
using testing::kX;
using testing::kY;
using testing::Picture;
using testing::TestRenderer;

double encoded(double x) {
  x = std::clamp(x, 0.0, 1.0);
  return 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055);
}
double decoded(double byte) {
  const double x = byte / 255;
  return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
}

PhysicalOptions linear(double radiance) {
  PhysicalOptions out;
  out.on = true;
  out.tone_mapping = ToneMapping::kLinear;
  out.environment = upright_environment([=](double) { return radiance; });
  return out;
}

// The sphere reflects all light, so that it has the radiance of the room: it is invisible.
TEST(Physical, WhiteSphereVanishesInWhiteRoom) {
  for (int metallic = 0; metallic <= 10; ++metallic)
    for (int roughness = 0; roughness <= 10; ++roughness) {
      TestRenderer s(std::string(kDark) + R"(<asset><material name="m" rgba="1 1 1 1" metallic=")" +
                     std::to_string(metallic / 10.0) + R"(" roughness=")" +
                     std::to_string(roughness / 10.0) +
                     R"("/></asset><worldbody><geom size="1" material="m"/></worldbody>)");
      s.options.physical = linear(1);
      const Picture seen = s.take({0, 0, 4}, kX, kY, grid_from_fovy(33, 33, 40, false));
      const double room = decoded(seen.at(0, 0)[0]);
      ASSERT_EQ(seen.id(0, 0), -1);
      for (int y = 0; y < 33; ++y)
        for (int x = 0; x < 33; ++x)
          for (int c = 0; c < 3; ++c)
            ASSERT_NEAR(decoded(seen.at(x, y)[c]), room, 0.01 * room)
                << metallic << " " << roughness << " at " << x << " " << y;
    }
}

TEST(Physical, MatteSphereHasLambertsCosine) {
  TestRenderer s(std::string(kDark) +
                 R"(<asset><material name="m" specular="0" rgba="1 .5 .2 1"/></asset><worldbody>
    <light type="directional" dir=".6 0 -.8" diffuse="1 1 1" castshadow="false"/>
    <geom size="1" material="m"/></worldbody>)");
  s.options.physical = linear(0);
  for (double x : {-0.9, -0.5, 0.0, 0.4, 0.7, 0.95}) {
    const double cosine = std::max(0.0, -0.6 * x + 0.8 * std::sqrt(1 - x * x));
    const auto seen = s.center({x, 0, 3}, kX, kY, 0.01);
    const double base[] = {255, 127.5, 51};
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(seen[c], encoded(kClassicLight * decoded(base[c]) * cosine), 1) << x << " " << c;
  }
}

// 1000 cd at a height of h m: E = 1000 / h^2 lux, and a white matte floor has the radiance E / pi.
TEST(Physical, CandelaFollowInverseSquareLaw) {
  for (double h : {1.5, 2.0, 3.0}) {
    TestRenderer s(std::string(kDark) +
                   R"(<asset><material name="m" specular="0" rgba="1 1 1 1"/></asset><worldbody>
      <light type="point" pos="0 0 )" +
                   std::to_string(h) +
                   R"(" diffuse="1 1 1" intensity="1000" range="100" castshadow="false"/>
      <geom type="plane" size="5 5 1" material="m"/></worldbody>)");
    s.options.physical = linear(0);
    const double radiance = 1000 / (h * h) / M_PI / maximum_radiance(kDefaultExposure);
    EXPECT_NEAR(s.center({0, 0, 1}, kX, kY, 0.01)[0], encoded(radiance), 1) << h;
  }
}

constexpr char kScene[] = R"(
  <asset><material name="a" rgba=".8 .3 .2 1" roughness=".3"/>
  <material name="b" rgba=".9 .8 .3 1" metallic="1" roughness=".2"/>
  <material name="glass" rgba=".3 .4 .9 .4"/></asset>
  <worldbody><light pos="1 1 3" dir="-.3 -.3 -1"/>
  <geom type="plane" size="5 5 1"/><geom type="box" size=".3 .2 .4" pos="0 0 .4" material="a"/>
  <geom size=".3" pos=".7 .2 .3" material="b"/>
  <geom type="capsule" size=".1 .3" pos="-.5 -.3 .4" euler="30 40 0" material="a"/>
  <geom type="box" size=".2 .2 .2" pos="-.2 .7 .2" material="glass"/></worldbody>)";

TEST(Physical, OnlyColoursDiffer) {
  TestRenderer s(kScene);
  s.options.shadows = true;
  const auto grid = grid_from_fovy(70, 50, 45, false);
  const auto shot = [&] { return s.take({0, 0, 3}, kX, kY, grid); };
  const Picture classic = shot();
  s.options.physical = linear(0.5);
  const Picture physical = shot();
  EXPECT_EQ(classic.depth, physical.depth);
  EXPECT_EQ(classic.ids, physical.ids);
  EXPECT_EQ(classic.normals, physical.normals);
  EXPECT_NE(classic.rgb, physical.rgb);
}

TEST(Physical, InstructionSetsAgree) {
  if (cpu_isa() < Isa::kAvx512) GTEST_SKIP() << "the CPU has no AVX-512";
  TestRenderer s(kScene);
  s.options.shadows = true;
  s.options.physical = linear(0.5);
  const auto grid = grid_from_fovy(320, 240, 45, false);
  const auto shot = [&] { return s.take({0, 0, 3}, kX, kY, grid).rgb; };
  const auto wide = shot();
  if constexpr (kHasAvx) s.render = render_tiles_avx2;
  const auto narrow = shot();
  int differ = 0;
  for (std::size_t i = 0; i < wide.size(); ++i) {
    EXPECT_LE(std::abs(wide[i] - narrow[i]), 1);
    differ += wide[i] != narrow[i];
  }
  EXPECT_LE(differ, 1e-5 * static_cast<double>(wide.size()));
}

// Next to a tall wall, a floor sees half of the surroundings; far from it, all of them.
TEST(Physical, WallHidesHalfOfTheSurroundings) {
  TestRenderer s(std::string(kDark) +
                 R"(<asset><material name="m" specular="0" rgba="0.4 0.4 0.4 1"/></asset><worldbody>
    <geom type="box" size="50 50 1" pos="0 0 -1" material="m"/>
    <geom type="box" size="1 50 50" pos="1 0 50" material="m"/></worldbody>)");
  s.options.physical = linear(1);
  const auto radiance = [&](double x) { return decoded(s.center({x, 0, 1}, kX, kY, 0.01)[0]); };
  const double open = radiance(-3), corner = radiance(-0.01) / open;
  s.options.physical.occlusion_reach = 0;
  EXPECT_NEAR(radiance(-0.01), open, 1e-3);
  // Half, and what the wall reflects of three quarters of the light.
  EXPECT_NEAR(corner, 0.5 + 0.5 * 0.75 * decoded(0.4 * 255), 0.02);
}

// The foot of a wall gets half of its light from the floor, which is red and receives three quarters of the
// light there.
TEST(Physical, FloorColoursTheWallThatStandsOnIt) {
  for (const char* floor : {R"(type="plane" size="9 9 .1" rgba="1 0 0 1")",
                            R"(type="box" size="9 9 1" pos="0 0 -1" rgba="1 0 0 1")",
                            R"(type="box" size="9 9 1" pos="0 0 -1" material="red")"}) {
    TestRenderer s(std::string(kDark) + R"(<asset>
    <texture name="t" type="2d" builtin="flat" rgb1="1 0 0" width="32" height="8"/>
    <material name="red" texture="t"/>
    <material name="m" specular="0" rgba="0.4 0.4 0.4 1"/></asset><worldbody>
    <geom type="box" size=".1 2 2" pos=".1 0 2" material="m"/><geom )" +
                   floor + "/></worldbody>");
    s.options.physical = linear(6);
    const auto wall = [&] { return s.center({-1, 0, 0.01}, {0, -1, 0}, {0, 0, 1}, 0.01); };
    const auto seen = wall();
    s.options.physical.occlusion_reach = 0;
    const double open = decoded(wall()[0]);
    EXPECT_NEAR(decoded(seen[0]) / open, 0.5 + 0.5 * 0.75, 0.01) << floor;
    for (int c : {1, 2}) EXPECT_NEAR(decoded(seen[c]) / open, 0.5, 0.01) << floor;
  }
}

// A sphere of radius r whose centre is at the distance d above a surface hides r^2 / d^2 of the
// surroundings, which the reach of 0.5 m lowers, and 7 r away nothing.
TEST(Physical, SphereHidesWhatItCovers) {
  TestRenderer s(std::string(kDark) +
                 R"(<asset><material name="m" specular="0" rgba="0.2 0.2 0.2 1"/></asset><worldbody>
    <geom type="plane" size="9 9 .1" material="m"/>
    <geom type="sphere" size=".05" pos="0 0 .1" rgba="0 0 0 1"/>
    <geom type="sphere" size=".1" pos="2 0 .2" rgba="0 0 0 1"/></worldbody>)");
  s.options.physical = linear(8);
  s.options.physical.occlusion_reach = 0;
  const auto radiance = [&](double x) { return decoded(s.center({x, 0, 0.04}, kX, kY, 0.01)[0]); };
  const double open = radiance(-3);
  s.options.physical.occlusion_reach = 0.5f;
  EXPECT_NEAR(radiance(0) / open, 1 - 0.25 * std::pow(1 - std::pow(0.05 / 0.35, 2), 2), 0.01);
  EXPECT_NEAR(radiance(2) / open, 1 - 0.25 * std::pow(1 - std::pow(0.1 / 0.5, 2), 2), 0.01);
  EXPECT_EQ(radiance(-0.41), open);
}

// A mesh of two small parts: the box around it is empty in the middle, where nothing is hidden.
TEST(Physical, MeshHidesNothingInTheMiddleOfItsBox) {
  TestRenderer s(std::string(kDark) +
                 R"(<asset><mesh name="m" vertex="-.3 -.1 -.1  -.3 .1 -.1  -.29 0 .1  -.31 0 .1
       .3 -.1 -.1  .3 .1 -.1  .29 0 .1  .31 0 .1" face="0 2 1  0 1 3  0 3 2  1 2 3  4 6 5  4 5 7  4 7 6  5 6 7"/></asset>
    <worldbody><geom type="plane" size="9 9 .1" rgba=".4 .4 .4 1"/><geom type="mesh" mesh="m" rgba="0 0 0 1"/></worldbody>)");
  s.options.physical = linear(6);
  const auto radiance = [&](double x) { return decoded(s.center({x, 0, 1}, kX, kY, 0.01)[0]); };
  EXPECT_EQ(radiance(0), radiance(-3));
  EXPECT_LT(radiance(0.33), 0.9 * radiance(-3));
}

// Six spheres at one place: each hides less than 2 % of the surroundings, and must not be left out.
TEST(Physical, SmallPartsAddUp) {
  std::string six;
  for (int i = 0; i < 6; ++i)
    six += R"(<geom type="sphere" size=".05" pos="0 0 .25" rgba="0 0 0 1"/>)";
  TestRenderer s(std::string(kDark) +
                 R"(<asset><material name="m" specular="0" rgba="0.2 0.2 0.2 1"/></asset><worldbody>
    <geom type="plane" size="9 9 .1" material="m"/>)" +
                 six + "</worldbody>");
  s.options.physical = linear(60);
  const auto radiance = [&](double x) { return decoded(s.center({x, 0, 0.04}, kX, kY, 0.01)[0]); };
  const double each = 0.04 * std::pow(1 - std::pow(0.2 / 0.35, 2), 2) - 1.0 / 256;
  EXPECT_NEAR(radiance(0) / radiance(-3), std::pow(1 - each, 6), 0.012);
}

}  // namespace
}  // namespace mjsense::render
