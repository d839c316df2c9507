// SPDX-License-Identifier: Apache-2.0
// Position of a texture on every shape, compared with MuJoCo's own renderer: 2D and cube, per
// object and per metre, repeated and not.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <string>

#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/testing/render_image.h"

namespace mjsense::sensors {
namespace {

struct Shape {
  const char *name, *geom;
  bool cubes = true;  // MuJoCo can map cube textures onto it
};

// Copies of `shape`, four in a row, one for each kind of material, with fine facets and ambient
// light only.
constexpr std::array kTextures{"flat", "cube"};
constexpr std::array kUniform{"false", "true"};
constexpr std::array kRepeats{"1 1", "3 2", ".5 4", "0 0"};
constexpr int kKinds = 16;

std::string kind_name(int kind) {
  return std::string(kTextures[kind / 8]) + ", texuniform " + kUniform[kind / 4 % 2] +
         ", texrepeat " + kRepeats[kind % 4];
}

std::string wall(const Shape& shape) {
  std::string materials, geoms;
  for (int i = 0; i < kKinds; ++i) {
    const std::string id = std::to_string(i);
    materials += "<material name='m" + id + "' texture='" + kTextures[i / 8] + "' texuniform='" +
                 kUniform[i / 4 % 2] + "' texrepeat='" + kRepeats[i % 4] + "'/>";
    geoms += std::string("<geom ") + shape.geom + " material='m" + id + "' euler='40 20 40' pos='" +
             testing::vec({0.7 * (i % 4), 0, 0.7 * (i / 4)}) + "'/>";
  }
  return R"(<mujoco><statistic extent="3" center="1 0 1"/>
    <visual><quality numslices="60" numstacks="60"/>
      <headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
    <asset><texture name="flat" type="2d" builtin="checker" rgb1=".8 .2 .2" rgb2=".2 .2 .8" mark="cross" markrgb="1 1 0" width="64" height="64"/>
      <texture name="cube" type="cube" builtin="checker" rgb1=".8 .2 .2" rgb2=".2 .8 .8" mark="cross" markrgb="1 1 0" width="64" height="64"/>
      <mesh name="tet" vertex="-.1 -.1 -.1 .3 0 0 0 .3 0 0 0 .3"/>
      <mesh name="mapped" vertex="-.1 -.1 -.1 .3 0 0 0 .3 0 0 0 .3" texcoord="0 0 1 0 .3 1 .8 .6" face="0 2 1 0 1 3 0 3 2 1 2 3"/>
      <hfield name="h" nrow="3" ncol="4" size=".2 .15 .1 .1" elevation="0 1 .2 .5  .3 0 1 .1  .9 .2 .4 .6"/>)" +
         materials + "</asset><worldbody>" + geoms +
         R"(<camera name="c" pos="1.05 -3.2 1.05" xyaxes="1 0 0 0 0 1" fovy="48"/></worldbody></mujoco>)";
}

class CameraTextures : public ::testing::TestWithParam<Shape> {};

INSTANTIATE_TEST_SUITE_P(Shapes, CameraTextures,
                         ::testing::Values(Shape{"sphere", "type='sphere' size='.2'"},
                                           Shape{"capsule", "type='capsule' size='.1 .15'"},
                                           Shape{"cylinder", "type='cylinder' size='.12 .2'"},
                                           Shape{"ellipsoid", "type='ellipsoid' size='.1 .15 .2'"},
                                           Shape{"box", "type='box' size='.1 .15 .2'"},
                                           Shape{"plane", "type='plane' size='.2 .15 .1'"},
                                           Shape{"mesh", "type='mesh' mesh='tet'"},
                                           Shape{"mapped_mesh", "type='mesh' mesh='mapped'", false},
                                           Shape{"height_field", "type='hfield' hfield='h'"}),
                         [](const auto& shape) { return shape.param.name; });

TEST_P(CameraTextures, ArePlacedAsInMujoco) {
  constexpr int kWidth = 200, kHeight = 200;
  const TestModel m(wall(GetParam()));
  CameraSensorCfg cfg;
  cfg.name = "cam";
  cfg.camera_name = "c";
  cfg.width = kWidth;
  cfg.height = kHeight;
  cfg.data_types = {"rgb", "segmentation"};
  const testing::Pair pair(cfg, m);
  if (!pair.opengl) GTEST_SKIP() << pair.missing;
  const auto ours = pair.by_rays<std::uint8_t>("rgb"), theirs = pair.by_opengl<std::uint8_t>("rgb");
  const auto ids = pair.by_rays<std::int32_t>("segmentation"),
             other_ids = pair.by_opengl<std::int32_t>("segmentation");
  int pixels[kKinds] = {}, off[kKinds] = {};
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int id = ids[2 * i];
    if (id < 0 || id != other_ids[2 * i]) continue;
    int worst = 0;
    for (int c = 0; c < 3; ++c)
      worst = std::max(worst, std::abs(ours[3 * i + c] - theirs[3 * i + c]));
    ++pixels[id];
    off[id] += worst > 60;
  }
  for (int kind = 0; kind < (GetParam().cubes ? kKinds : kKinds / 2); ++kind) {
    EXPECT_GT(pixels[kind], 50) << kind_name(kind);
    EXPECT_LE(off[kind], 0.08 * pixels[kind]) << kind_name(kind) << ", of " << pixels[kind];
  }
}

// On an infinite plane the pattern begins at the plane's position, along both axes.
TEST(CameraTextures, OfInfinitePlanesBeginAtTheirPosition) {
  for (const char* size : {"0 0 .1", ".4 0 .1", "0 .4 .1"}) {
    for (const char* uniform : kUniform) {
      const TestModel m(
          std::string(
              R"(<mujoco><visual><map zfar="20"/><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual>
        <statistic extent="2"/><asset><texture name="t" type="2d" builtin="checker" rgb1=".8 .2 .2" rgb2=".2 .2 .8" width="64" height="64"/>
        <material name="m" texture="t" texrepeat="3 2" texuniform=")") +
          uniform +
          R"("/></asset><worldbody><geom type="plane" material="m" euler="0 0 20" size=")" + size +
          R"("/><camera name="c" pos=".1 .2 2"/></worldbody></mujoco>)");
      CameraSensorCfg cfg;
      cfg.name = "cam";
      cfg.camera_name = "c";
      cfg.width = cfg.height = 100;
      cfg.data_types = {"rgb"};
      const testing::Pair pair(cfg, m);
      if (!pair.opengl) GTEST_SKIP() << pair.missing;
      EXPECT_GT(pair.psnr(), 25) << size << ", texuniform " << uniform;
    }
  }
}

}  // namespace
}  // namespace mjsense::sensors
