// SPDX-License-Identifier: Apache-2.0
// The same scene, rendered by rays and by MuJoCo's own renderer.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/camera/camera_sensor.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

constexpr char kGlScene[] = R"(<mujoco>
  <asset><texture name="sky" type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2="0 0 0" width="64" height="64"/>
    <texture name="t" type="2d" builtin="checker" rgb1=".8 .2 .2" rgb2=".2 .2 .8" width="64" height="64"/>
    <texture name="q" type="cube" builtin="gradient" rgb1="1 1 0" rgb2="0 1 1" width="16" height="16"/>
    <material name="m" texture="t" texrepeat="3 3"/><material name="n" texture="q"/>
    <mesh name="tet" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/>
    <hfield name="h" nrow="3" ncol="4" size=".4 .3 .2 .1" elevation="0 1 .2 .5  .3 0 1 .1  .9 .2 .4 .6"/></asset>
  <worldbody><light pos="1 -1 4" dir="-.2 .2 -1" castshadow="true" cutoff="60"/>
    <geom type="plane" size="5 5 .1" material="m"/>
    <geom type="box" size=".3 .2 .1" pos="0 0 1" euler="20 10 5" material="n"/>
    <geom type="capsule" size=".05 .3" pos="0 -.4 .4" euler="30 0 0" rgba=".2 .9 .2 1"/>
    <geom type="mesh" mesh="tet" pos=".5 .2 0"/><geom type="hfield" hfield="h" pos="-1 -.5 .1"/>
    <geom type="ellipsoid" size=".3 .2 .1" pos="-.6 .3 .2" rgba=".9 .5 .1 1"/>
    <geom type="sphere" size=".2" pos=".9 -.6 .2" rgba=".1 .5 .9 1"/>
    <geom type="cylinder" size=".1 .3" pos="-.3 -.6 .3" material="m"/>
    <camera name="c" pos="0 -2.5 1.5" xyaxes="1 0 0 0 .5 1"/></worldbody></mujoco>)";

// Cloth, a rope, a soft solid and a skin, all of them bent.
constexpr char kSoftScene[] = R"(<mujoco>
  <asset><texture name="sky" type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2="0 0 0" width="64" height="64"/>
    <texture name="t" type="2d" builtin="checker" rgb1=".8 .2 .2" rgb2=".9 .8 .7" width="64" height="64"/>
    <material name="m" texture="t" texrepeat="3 3"/></asset>
  <worldbody><light pos="1 -1 4" dir="-.2 .2 -1" castshadow="true" cutoff="60"/>
    <geom type="plane" size="0 0 .1" rgba=".4 .5 .6 1"/>
    <flexcomp name="cloth" type="grid" dim="2" count="9 7 1" spacing=".1 .1 .1" pos="-.8 -.3 .6" euler="30 20 10" radius=".01" material="m"/>
    <flexcomp name="rope" type="grid" dim="1" count="9 1 1" spacing=".1 .1 .1" pos=".4 .5 .9" euler="0 20 70" radius=".03" rgba=".9 .8 .2 1"/>
    <flexcomp name="jelly" type="grid" dim="3" count="4 4 4" spacing=".1 .1 .1" pos=".2 -.5 .3" euler="0 0 30" radius=".02" rgba=".2 .8 .3 1"/>
    <body name="a" pos=".6 -.9 .5" euler="0 30 0"><geom size=".01" group="4"/>
      <body name="b" pos=".3 0 0" euler="40 50 0"><geom size=".01" group="4"/></body></body>
    <camera name="c" pos="0 -2.5 1.5" xyaxes="1 0 0 0 .5 1"/></worldbody>
  <deformable><skin name="s" material="m" inflate=".01"
    vertex="0 -.2 0 0 .2 0  .15 -.2 0 .15 .2 0  .3 -.2 0 .3 .2 0  .45 -.2 0 .45 .2 0  .6 -.2 0 .6 .2 0"
    texcoord="0 0 0 1 .25 0 .25 1 .5 0 .5 1 .75 0 .75 1 1 0 1 1" face="0 2 1 1 2 3 2 4 3 3 4 5 4 6 5 5 6 7 6 8 7 7 8 9">
    <bone body="a" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3 4 5" vertweight="1 1 1 1 .5 .5"/>
    <bone body="b" bindpos=".3 0 0" bindquat="1 0 0 0" vertid="4 5 6 7 8 9" vertweight=".5 .5 1 1 1 1"/></skin></deformable></mujoco>)";

class CameraAgainstOpenGL : public ::testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Scenes, CameraAgainstOpenGL, ::testing::Values(kGlScene, kSoftScene),
                         [](const auto& scene) { return scene.index == 0 ? "rigid" : "soft"; });

TEST_P(CameraAgainstOpenGL, DepthIdsAndColoursAgree) {
  constexpr int kWidth = 160, kHeight = 120, kCount = kWidth * kHeight;
  scene::SceneCfg cfg;
  scene::EntityCfg entity;
  entity.model.xml = GetParam();
  cfg.entities.emplace_back("w", entity);
  for (const char* name : {"rays", "opengl", "opengl smooth"}) {
    auto camera = std::make_shared<CameraSensorCfg>();
    camera->name = name;
    camera->renderer =
        std::string(name) == "rays" ? CameraRenderer::kRays : CameraRenderer::kOpenGl;
    camera->samples = std::string(name) == "opengl smooth" ? 4 : 1;
    camera->camera_name = "w/c";
    camera->width = kWidth;
    camera->height = kHeight;
    camera->data_types = {"rgb", "depth", "segmentation"};
    camera->use_shadows = true;
    cfg.sensors.push_back(camera);
  }
  auto scene = std::make_shared<scene::Scene>(std::move(cfg));
  std::unique_ptr<sim::Simulation> sim;
  try {
    sim = std::make_unique<sim::Simulation>(scene, sim::SimulationCfg{});
  } catch (const RuntimeError& e) {
    GTEST_SKIP() << e.what();
  }
  Sensor &rays = scene->sensor("rays"), &gl = scene->sensor("opengl");
  sim->refresh(rays);
  sim->refresh(gl);
  const auto depth = rays.field("depth").data.row<float>(0),
             gl_depth = gl.field("depth").data.row<float>(0);
  const auto ids = rays.field("segmentation").data.row<std::int32_t>(0);
  const auto gl_ids = gl.field("segmentation").data.row<std::int32_t>(0);
  const auto rgb = rays.field("rgb").data.row<std::uint8_t>(0),
             gl_rgb = gl.field("rgb").data.row<std::uint8_t>(0);
  std::vector<float> errors;
  int other_id = 0, far_off = 0;
  double square = 0;
  for (int i = 0; i < kCount; ++i) {
    errors.push_back(std::abs(depth[i] - gl_depth[i]));
    far_off += errors.back() > 0.01;
    other_id += ids[2 * i] != gl_ids[2 * i] || ids[2 * i + 1] != gl_ids[2 * i + 1];
    for (int c = 0; c < 3; ++c) square += std::pow(rgb[3 * i + c] - gl_rgb[3 * i + c], 2);
  }
  std::nth_element(errors.begin(), errors.begin() + kCount / 2, errors.end());
  EXPECT_LT(errors[kCount / 2], 1e-4);  // m, median
  EXPECT_LT(far_off, kCount / 200);     // silhouettes, and the facets of MuJoCo's shapes
  EXPECT_LT(other_id, kCount / 200);
  const double psnr = 10 * std::log10(255.0 * 255.0 * 3 * kCount / square);
  EXPECT_GT(psnr, 28);
  RecordProperty("psnr", std::to_string(psnr));
  // Several samples smooth the colours, but depth and ids remain those of the pixel centres.
  Sensor& smooth = scene->sensor("opengl smooth");
  sim->refresh(smooth);
  EXPECT_FALSE(std::ranges::equal(gl_rgb, smooth.field("rgb").data.row<std::uint8_t>(0)));
  EXPECT_TRUE(std::ranges::equal(gl_depth, smooth.field("depth").data.row<float>(0)));
  EXPECT_TRUE(std::ranges::equal(gl_ids, smooth.field("segmentation").data.row<std::int32_t>(0)));
}

}  // namespace
}  // namespace mjsense::sensors
