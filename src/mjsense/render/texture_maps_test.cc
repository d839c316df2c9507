// SPDX-License-Identifier: Apache-2.0
// The maps of materials in physically based images: each against a formula, or against the same
// material with the map's value as a constant.

#include "mjsense/render/view/texture_maps.h"

#include <gtest/gtest.h>

#include <cmath>

#include "mjsense/core/testing/error_of.h"
#include "mjsense/render/light/tone_map.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::kDark;
using testing::kX;
using testing::kY;
using testing::TestRenderer;

std::string flat(const std::string& rgb, const std::string& more = R"(type="2d" height="4")") {
  return R"(<texture name="t" builtin="flat" width="4" rgb1=")" + rgb + "\" rgb2=\"" + rgb + "\" " +
         more + "/>";
}
std::string material(const std::string& attributes, const std::string& role) {
  return R"(<material name="m" )" + attributes + R"(><layer role=")" + role +
         R"(" texture="t"/></material>)";
}

// Linear colours of the point below the camera.
std::array<double, 3> below(const std::string& assets, const std::string& world, double environment,
                            std::array<double, 3> from = {0, 0, 3}) {
  TestRenderer s(std::string(kDark) + "<asset>" + assets + "</asset><worldbody>" + world +
                 "</worldbody>");
  s.options.physical.on = true;
  s.options.physical.tone_mapping = ToneMapping::kLinear;
  s.options.physical.environment = upright_environment([=](double) { return environment; });
  const auto seen = s.center(from, kX, kY, 0.01);
  return {srgb_decode(seen[0] / 255.0), srgb_decode(seen[1] / 255.0), srgb_decode(seen[2] / 255.0)};
}

constexpr char kBall[] =
    R"(<light type="directional" dir=".3 0 -1" diffuse=".5 .5 .5" castshadow="false"/>
       <geom size="1" material="m"/>)";

TEST(TextureMaps, RoughnessAndMetallicAreFactors) {
  const auto ball = [](const std::string& assets) {
    return below(assets, kBall, 0.5, {0.1, 0, 3});
  };
  const auto plain = ball(R"(<material name="m" rgba=".9 .6 .3 1" roughness=".4" metallic=".8"/>)");
  const std::string orm = "1 .5 1", grey = ".5 .5 .5";
  for (const auto& found :
       {ball(flat(orm) + material(R"(rgba=".9 .6 .3 1" roughness=".8" metallic=".8")", "orm")),
        ball(flat(grey) +
             material(R"(rgba=".9 .6 .3 1" roughness=".8" metallic=".8")", "roughness"))})
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(found[c], plain[c], 0.006) << c;
  // A factor that is not set is 1.
  const auto rough = ball(R"(<material name="m" rgba=".9 .6 .3 1" roughness=".5" metallic=".5"/>)");
  const auto mapped = ball(flat("1 .5 .5") + material(R"(rgba=".9 .6 .3 1")", "orm"));
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(mapped[c], rough[c], 0.006) << c;
}

// The map tilts the normal by atan(3 / 4) in a direction of the surface: N . L of a light that shines
// straight down is 0.8, and N . L of one along the tilted normal is 1.
TEST(TextureMaps, NormalsHaveLambertsCosine) {
  const struct {
    const char *geom, *right, *up;  // light that shines against the normal tilted to it
  } kCases[] = {
      // u grows along x, and the rows of the texture downwards along y
      {R"(type="plane" size="2 2 1")", "-.6 0 -.8", "0 -.6 -.8"},
      {R"(type="box" size="1 1 1" pos="0 0 -1")", "-.6 0 -.8", "0 -.6 -.8"},
      // u grows with the azimuth; at the pole seen from above near +x: right is y, up is -x
      {R"(type="mesh" mesh="quad")", "0 -.6 -.8", ".6 0 -.8"},
  };
  // u grows along y, and v along -x in MuJoCo's file coordinates, whose rows are upwards.
  const std::string quad =
      R"(<mesh name="quad" vertex="-1 -1 0 1 -1 0 1 1 0 -1 1 0 0 0 -1" face="0 1 2 0 2 3 1 0 4 2 1 4 3 2 4 0 3 4"
         texcoord="0 0 0 1 1 1 1 0 0 0"/>)";
  for (const auto& c : kCases) {
    const auto lit = [&](const char* rgb, const std::string& dir) {
      return below(quad + flat(rgb) + material(R"(specular="0" rgba="1 1 1 1")", "normal"),
                   R"(<light type="directional" diffuse="1 1 1" castshadow="false" dir=")" + dir +
                       R"("/><geom material="m" )" + c.geom + "/>",
                   0, {0.2, 0.1, 3})[1];
    };
    constexpr char kRight[] = ".8 .5 .9", kUp[] = ".5 .8 .9";
    EXPECT_NEAR(lit(".5 .5 1", "0 0 -1"), kClassicLight, 0.01) << c.geom;
    EXPECT_NEAR(lit(kRight, "0 0 -1"), 0.8 * kClassicLight, 0.01) << c.geom;
    EXPECT_NEAR(lit(kRight, c.right), kClassicLight, 0.01) << c.geom;
    EXPECT_NEAR(lit(kUp, c.up), kClassicLight, 0.01) << c.geom;
  }
}

TEST(TextureMaps, EmissionIsShownAsItIs) {
  const auto seen = below(flat(".2 .6 .9") + material(R"(specular="0" rgba="0 0 0 1")", "emissive"),
                          R"(<geom type="plane" size="2 2 1" material="m"/>)", 0);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(seen[c], srgb_decode(std::array{0.2, 0.6, 0.9}[c]), 0.008) << c;
}

TEST(TextureMaps, OcclusionDarkensTheSurroundings) {
  const std::string plane = R"(<geom type="plane" size="2 2 1" material="m"/>)";
  const auto look = [&](const char* rgb) {
    return below(flat(rgb) + material(R"(specular="0" rgba=".05 .05 .05 1")", "occlusion"), plane,
                 100)[0];
  };
  EXPECT_NEAR(look(".5 .5 .5") / look("1 1 1"), 0.5, 0.01);
}

TEST(TextureMaps, OpacityBlends) {
  const std::string floor = R"(<geom type="plane" size="2 2 1" pos="0 0 -1" rgba="1 1 1 1"/>)";
  const auto look = [&](const char* rgb) {
    return below(flat(rgb) + material(R"(specular="0" rgba="0 0 0 1")", "opacity"),
                 floor + R"(<geom type="box" size="1 1 .1" material="m"/>)", 1)[0];
  };
  const double open = look("0 0 0"), closed = look("1 1 1");
  EXPECT_LT(closed, 0.02);
  EXPECT_GT(open, 0.2);
  EXPECT_NEAR(look(".5 .5 .5"), 0.5 * (open + closed), 0.1 * open);
}

TEST(TextureMaps, UnsuitableTexturesAreOneClearError) {
  const auto error = [](const std::string& texture, const std::string& role, int channels = 3) {
    const TestRenderer s("<asset>" + texture + material("", role) + "</asset>");
    s.model->tex_nchannel[0] = channels;
    return error_of<ValueError>([&] { check_texture_maps(s.model.get()); });
  };
  EXPECT_EQ(error(flat("1 1 1"), "orm"), "");
  EXPECT_EQ(
      error(flat("1 1 1", R"(type="cube" height="24")"), "roughness"),
      "material 'm': its texture 't' for the role roughness is a cube map; it must be of type 2d");
  EXPECT_EQ(error(flat("1 1 1"), "roughness", 1), "");
  EXPECT_EQ(error(flat("1 1 1"), "normal", 1),
            "material 'm': its texture 't' for the role normal has 1 channel; it must have 3 or 4");
}

}  // namespace
}  // namespace mjsense::render
