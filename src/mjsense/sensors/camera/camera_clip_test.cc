// SPDX-License-Identifier: Apache-2.0
// Cameras inside a housing: with clip_near "model" the housing is clipped as in MuJoCo's renderer.

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/testing/render_image.h"

namespace mjsense::sensors {
namespace {

// A camera with a lens of 3 cm and a shell around it, made of a mesh and of shapes that intersect
// the near plane at 4 cm; other objects outside, some of which can move.
constexpr char kHousing[] = R"(<mujoco><statistic extent="2" center="0 0 0"/>
  <visual><map znear="0.02"/><quality numslices="60" numstacks="60" shadowsize="1024"/></visual>
  <asset><mesh name="shell" vertex="-.05 -.05 .02  .05 -.05 .02  0 .06 .02  -.05 -.05 -.03  .05 -.05 -.03  0 .06 -.03"/>
    <hfield name="h" nrow="3" ncol="3" size=".5 .5 .1 .1" elevation="0 .2 0 .5 1 .3 0 .4 .2"/></asset>
  <worldbody><light pos="1 1 3" dir="-.3 -.3 -1"/>
    <geom type="plane" size="3 3 .1" rgba=".5 .6 .7 1"/><geom type="hfield" hfield="h" pos=".6 .6 0"/>
    <geom type="box" size=".2 .3 .1" pos="-.5 .3 .1" rgba=".9 .3 .2 1"/>
    <geom type="cylinder" size=".012 .01" pos="0 0 .97" rgba="0 1 0 1"/>
    <geom type="mesh" mesh="shell" pos="0 0 1" rgba="1 0 1 1"/>
    <geom type="capsule" size=".004 .03" pos=".01 0 .965" euler="0 40 0" rgba="1 1 0 1"/>
    <geom type="sphere" size=".01" pos="-.02 .01 .962" rgba="0 1 1 .5"/>
    <body pos=".1 -.3 .3"><freejoint/><geom type="ellipsoid" size=".1 .2 .05" rgba=".2 .9 .3 1"/></body>
    <camera name="c" pos="0 0 1" fovy="70"/></worldbody></mujoco>)";

CameraSensorCfg wide(std::vector<std::string> types) {
  CameraSensorCfg cfg;
  cfg.name = "cam";
  cfg.camera_name = "c";
  cfg.width = 120;
  cfg.height = 90;
  cfg.data_types = std::move(types);
  cfg.clip_near = "model";
  return cfg;
}

TEST(CameraClip, ClipsAtTheModelsNearPlaneLikeOpenGL) {
  const TestModel m(kHousing);
  // With shadows, fixed geoms are drawn from a stored layer.
  for (const bool shadows : {false, true}) {
    CameraSensorCfg cfg = wide({"rgb", "depth", "segmentation"});
    cfg.use_shadows = shadows;
    const testing::Pair pair(cfg, m);
    if (!pair.opengl) GTEST_SKIP() << pair.missing;
    EXPECT_LT(pair.other_ids(), 0.006);
    EXPECT_LT(pair.other_depths(0.002), 0.006);
    EXPECT_GT(pair.psnr(), 27);  // MuJoCo shades the coarse height field at its vertices
  }
}

// Every field shows what is beyond the near plane: nothing is nearer. Without the near plane,
// nearer surfaces are visible.
TEST(CameraClip, ClipsEveryField) {
  const TestModel m(kHousing);
  rays::RayScene rays(m.model, 1);
  rays.update(m.world());
  CameraSensorCfg cfg = wide({"rgb", "depth", "segmentation", "normals", "point_cloud", "flow"});
  const auto clipped = testing::shoot(cfg, m, rays);
  cfg.clip_near = "none";
  const auto all = testing::shoot(cfg, m, rays);
  cfg.near = 0.04;
  const auto by_hand = testing::shoot(cfg, m, rays);
  int nearer = 0;
  const auto depth = clipped->field("depth").data.row<float>(0);
  const auto points = clipped->field("point_cloud").data.row<float>(0);
  for (std::size_t i = 0; i < depth.size(); ++i) {
    EXPECT_GE(depth[i], 0.04f);
    EXPECT_EQ(points[3 * i + 2], -depth[i]);
    nearer += all->field("depth").data.row<float>(0)[i] < 0.04f;
  }
  // These are the small geoms. The shell shows only its back faces, which are invisible.
  EXPECT_GT(nearer, 100);
  for (const Field& field : clipped->fields()) {
    const Array& other = by_hand->field(field.name).data;
    ASSERT_EQ(field.data.bytes(), other.bytes());
    EXPECT_EQ(std::memcmp(field.data.data(), other.data(), other.bytes()), 0) << field.name;
  }
}

TEST(CameraClip, ErrorsNameTheLimits) {
  const auto message = [](const CameraSensorCfg& cfg) -> std::string {
    try {
      const TestModel m(kHousing);
      rays::RayScene rays(m.model, 1);
      rays.update(m.world());
      testing::shoot(cfg, m, rays);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  CameraSensorCfg cfg = wide({"rgb"});
  cfg.near = 0.1;
  EXPECT_NE(message(cfg).find("near is 0.1 m and clip_near is 'model'"), std::string::npos);
  cfg.near = 0;
  cfg.far = 0.03;
  EXPECT_NE(message(cfg).find("clips at near 0.04 m and far 0.03 m"), std::string::npos);
  cfg.clip_far = "model";
  EXPECT_NE(message(cfg).find("far is 0.03 m and clip_far is 'model'"), std::string::npos);
}

// The far plane is at 2 m: it cuts the plates at 3 m, and a plate across it.
TEST(CameraClip, ClipsAtTheModelsFarPlaneLikeOpenGL) {
  const TestModel m(
      R"(<mujoco><visual><map znear=".01" zfar=".5"/></visual><statistic extent="4" center="0 0 0"/>
    <worldbody><light pos="0 0 3" diffuse=".6 .6 .6"/>
    <geom type="box" size=".5 .5 .1" pos="0 .6 -3" rgba="1 0 0 1"/>
    <geom type="box" size=".4 .4 .1" pos="0 -.4 -1.5" rgba="0 1 0 1"/>
    <geom type="box" size=".1 .3 1" pos=".7 0 -2" euler="0 20 0" rgba="0 0 1 1"/>
    <camera name="c" fovy="70"/></worldbody></mujoco>)");
  CameraSensorCfg cfg = wide({"rgb", "depth", "segmentation"});
  cfg.clip_far = "model";
  rays::RayScene rays(m.model, 1);
  rays.update(m.world());
  const auto clipped = testing::shoot(cfg, m, rays);
  cfg.clip_far = "none";
  const auto all = testing::shoot(cfg, m, rays);
  cfg.far = 2;
  const auto by_hand = testing::shoot(cfg, m, rays);
  int farther = 0;
  for (const float depth : clipped->field("depth").data.row<float>(0)) EXPECT_LE(depth, 2);
  for (const float depth : all->field("depth").data.row<float>(0)) farther += depth > 2;
  EXPECT_GT(farther, 500);
  for (const Field& field : clipped->fields()) {
    const Array& other = by_hand->field(field.name).data;
    EXPECT_EQ(std::memcmp(field.data.data(), other.data(), other.bytes()), 0) << field.name;
  }
  cfg.far = 0;
  cfg.clip_far = "model";
  const testing::Pair pair(cfg, m);
  if (!pair.opengl) GTEST_SKIP() << pair.missing;
  EXPECT_LT(pair.other_ids(), 0.006);
  EXPECT_GT(pair.psnr(), 30);
}

}  // namespace
}  // namespace mjsense::sensors
