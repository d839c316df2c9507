// SPDX-License-Identifier: Apache-2.0
// Sites and tendons in images: as in MuJoCo's visualiser, and absent unless requested.

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/testing/render_image.h"

namespace mjsense::sensors {
namespace {

// Sites of every shape on bodies that move; tendons over a sphere, through a cylinder, over a
// pulley and at their limit, and a slack one.
constexpr char kScene[] = R"(<mujoco>
  <visual><quality numslices="60" numstacks="60" shadowsize="1024"/></visual><statistic extent="2" center="0 0 0"/>
  <asset><texture name="t" type="2d" builtin="checker" rgb1=".8 .2 .2" rgb2=".2 .2 .8" width="64" height="64"/>
    <texture name="q" type="cube" builtin="gradient" rgb1="1 1 0" rgb2="0 1 1" width="16" height="16"/>
    <material name="m" texture="t" texrepeat="40 30" texuniform="true"/><material name="q" texture="q" specular=".9"/>
    <material name="rope" rgba=".7 .5 .2 1"/></asset>
  <worldbody><light pos="1 -1 4" dir="-.2 .2 -1" cutoff="60"/>
    <geom type="plane" size="3 3 .1" rgba=".5 .6 .7 1"/>
    <site name="goal" size=".12" pos="-.8 -.5 .3" rgba=".1 .9 .1 .5"/>
    <site name="left" size=".02" pos="-.7 .2 1.2"/><site name="right" size=".02" pos=".6 .2 1.2"/>
    <site name="far" size=".02" pos=".9 .4 1.3" group="2"/><site name="side" size=".01" pos="0 .2 1" group="4"/>
    <body name="a" pos="0 .3 .8"><joint type="hinge" axis="0 1 0"/><geom name="ball" size=".15" mass="1"/>
      <site name="end" pos=".3 0 -.1" size=".03 .1" type="capsule" material="q"/>
      <body pos=".3 0 -.3"><joint type="hinge" axis="0 1 0"/><geom name="drum" type="cylinder" size=".08 .1" euler="90 0 0" mass="1"/>
        <site name="inside" size=".01"/><site name="tip" pos=".2 0 -.2" type="box" size=".05 .08 .03" material="m"/></body></body>
    <body pos="-.4 -.2 .4"><freejoint/><geom type="box" size=".05 .05 .05" mass=".5"/>
      <site name="egg" type="ellipsoid" size=".1 .06 .14" pos="0 0 .2" rgba=".9 .5 .1 1"/>
      <site name="can" type="cylinder" size=".06 .1" pos=".2 0 .1" material="m"/></body>
    <body name="weight" pos=".6 .2 .6"><joint name="drop" type="slide" axis="0 0 1"/><geom size=".05" mass="1"/><site name="hook" size=".02"/></body>
    <camera name="c" pos="0 -2.6 1.6" xyaxes="1 0 0 0 .45 .9" fovy="45"/></worldbody>
  <tendon><spatial name="over" width=".012" rgba=".9 .1 .6 1"><site site="left"/><geom geom="ball" sidesite="side"/><site site="tip"/></spatial>
    <spatial name="through" width=".02" material="rope"><site site="left"/><geom geom="drum" sidesite="inside"/><site site="far"/></spatial>
    <spatial name="string" width=".01" limited="true" range="0 1.8" rgba="0 .4 .9 1"><site site="left"/><site site="right"/></spatial>
    <spatial name="stretched" width=".015" limited="true" range="0 .55" stiffness="0"><site site="right"/><site site="hook"/></spatial>
    <spatial name="pulley" width=".01" group="3"><site site="left"/><site site="end"/><pulley divisor="2"/><site site="end"/><site site="far"/></spatial>
    <fixed name="fixed"><joint joint="drop" coef="1"/></fixed></tendon></mujoco>)";

CameraSensorCfg sight(std::vector<std::string> types, std::vector<int> groups) {
  CameraSensorCfg cfg;
  cfg.name = "cam";
  cfg.camera_name = "c";
  cfg.width = 160;
  cfg.height = 120;
  cfg.data_types = std::move(types);
  cfg.enabled_site_groups = cfg.enabled_tendon_groups = std::move(groups);
  return cfg;
}

void run(const TestModel& m, int steps) {
  for (int i = 0; i < steps; ++i) mj_step(m.model, m.data);
  mj_forward(m.model, m.data);
}

TEST(CameraMarkers, EqualThoseOfMujocosScene) {
  const TestModel m(kScene);
  render::Markers markers(m.model, {0x7, 0xf, true});
  mjvScene scene;
  mjv_defaultScene(&scene);
  mjv_makeScene(m.model, &scene, 1000);
  mjvOption options;
  mjv_defaultOption(&options);
  options.tendongroup[3] = 1;
  mjvCamera camera;
  mjv_defaultCamera(&camera);
  std::set<int> tendons, types;
  for (int i = 0; i < 20; ++i) {
    run(m, 10);
    markers.copy(m.model, m.data);
    mjv_updateScene(m.model, m.data, &options, nullptr, &camera, mjCAT_ALL, &scene);
    std::size_t next = 0;
    for (int g = 0; g < scene.ngeom; ++g) {
      const mjvGeom& theirs = scene.geoms[g];
      if (theirs.objtype != mjOBJ_SITE && theirs.objtype != mjOBJ_TENDON) continue;
      ASSERT_LT(next, markers.all().size());
      const render::Marker& ours = markers.all()[next++];
      EXPECT_EQ(ours.object, theirs.objtype);
      EXPECT_EQ(ours.id, theirs.objid);
      EXPECT_EQ(ours.shape.type, theirs.type);
      EXPECT_TRUE(std::equal(theirs.pos, theirs.pos + 3, ours.shape.pos));
      EXPECT_TRUE(std::equal(theirs.mat, theirs.mat + 9, ours.shape.mat));
      EXPECT_TRUE(std::equal(theirs.rgba, theirs.rgba + 4, ours.rgba));
      // MuJoCo's sizes are half sizes along the axes; ours are those of a geom of that type.
      const bool round = theirs.type == mjGEOM_CAPSULE || theirs.type == mjGEOM_CYLINDER;
      EXPECT_EQ(ours.shape.size[0], theirs.size[0]);
      EXPECT_EQ(ours.shape.size[1], theirs.size[round ? 2 : 1]) << theirs.type;
      EXPECT_EQ(ours.shape.size[2], round ? 0 : theirs.size[2]) << theirs.type;
      types.insert(theirs.type);
      if (theirs.objtype == mjOBJ_TENDON) tendons.insert(theirs.objid);
    }
    EXPECT_EQ(next, markers.all().size());
    EXPECT_LE(next, markers.capacity());
  }
  EXPECT_EQ(tendons, (std::set<int>{0, 1, 2, 3, 4}));
  EXPECT_EQ(types, (std::set<int>{mjGEOM_SPHERE, mjGEOM_CAPSULE, mjGEOM_ELLIPSOID, mjGEOM_CYLINDER,
                                  mjGEOM_BOX}));
  mjv_freeScene(&scene);
}

TEST(CameraMarkers, LookAsWithOpenGL) {
  const TestModel m(kScene);
  for (int i = 0; i < 2; ++i) {
    run(m, 60 * i);
    CameraSensorCfg cfg = sight({"rgb", "depth", "segmentation"}, {0, 1, 2, 3});
    cfg.use_shadows = true;
    const testing::Pair pair(cfg, m);
    if (!pair.opengl) GTEST_SKIP() << pair.missing;
    EXPECT_LT(pair.other_ids(), 0.006);
    EXPECT_LT(pair.other_depths(0.01), 0.006);
    EXPECT_GT(pair.psnr(), 30);
    std::set<std::pair<int, int>> seen;
    const auto ids = pair.by_opengl<std::int32_t>("segmentation");
    for (std::size_t k = 0; k < ids.size(); k += 2) seen.insert({ids[k + 1], ids[k]});
    for (const int tendon : {0, 1, 2, 3, 4})
      EXPECT_EQ(seen.count({mjOBJ_TENDON, tendon}), 1u) << tendon;
    EXPECT_GE(seen.size(), 18u);
  }
}

TEST(CameraMarkers, AreVisibleOnlyIfTheirGroupsAre) {
  const TestModel m(kScene);
  rays::RayScene rays(m.model, 1);
  rays.update(m.world());
  const auto objects = [&](std::vector<int> sites, std::vector<int> tendons) {
    CameraSensorCfg cfg = sight({"segmentation"}, {});
    cfg.enabled_site_groups = std::move(sites);
    cfg.enabled_tendon_groups = std::move(tendons);
    const auto camera = testing::shoot(cfg, m, rays);
    std::set<std::pair<int, int>> seen;
    const auto ids = camera->field("segmentation").data.row<std::int32_t>(0);
    for (std::size_t k = 0; k < ids.size(); k += 2) seen.insert({ids[k + 1], ids[k]});
    return seen;
  };
  for (const auto& [type, id] : objects({}, {})) EXPECT_TRUE(type == mjOBJ_GEOM || type == -1);
  const int far = mj_name2id(m.model, mjOBJ_SITE, "far"),
            goal = mj_name2id(m.model, mjOBJ_SITE, "goal");
  EXPECT_EQ(objects({0}, {}).count({mjOBJ_SITE, goal}), 1u);
  EXPECT_EQ(objects({0}, {}).count({mjOBJ_SITE, far}), 0u);
  EXPECT_EQ(objects({2}, {}).count({mjOBJ_SITE, far}), 1u);
  EXPECT_EQ(objects({2}, {}).count({mjOBJ_SITE, goal}), 0u);
  EXPECT_EQ(objects({}, {3}).count({mjOBJ_TENDON, 4}), 1u);
  EXPECT_EQ(objects({}, {0}).count({mjOBJ_TENDON, 4}), 0u);
  EXPECT_THROW(objects({6}, {}), ValueError);
  EXPECT_THROW(objects({}, {-1}), ValueError);
}

TEST(CameraMarkers, BelongToTheirBodies) {
  const TestModel m(kScene);
  rays::RayScene rays(m.model, 1);
  rays.update(m.world());
  const auto camera =
      testing::shoot(sight({"segmentation", "body_segmentation", "flow"}, {0}), m, rays);
  const auto ids = camera->field("segmentation").data.row<std::int32_t>(0);
  const auto bodies = camera->field("body_segmentation").data.row<std::int32_t>(0);
  const auto flow = camera->field("flow").data.row<float>(0);
  int sites = 0, tendons = 0;
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    if (ids[2 * i + 1] == mjOBJ_SITE) {
      ++sites;
      EXPECT_EQ(bodies[i], m.model->site_bodyid[ids[2 * i]]);
      EXPECT_EQ(flow[2 * i], 0);
    } else if (ids[2 * i + 1] == mjOBJ_TENDON) {
      ++tendons;
      EXPECT_EQ(bodies[i], -1);
      EXPECT_TRUE(std::isnan(flow[2 * i]));
    }
  }
  EXPECT_GT(sites, 100);
  EXPECT_GT(tendons, 50);
}

// A reflective box is a mirror also if it is a site, and it reflects sites.
TEST(CameraMarkers, ReflectAndAreReflected) {
  const TestModel m(R"(<mujoco><statistic extent="2" center="0 0 0"/>
    <asset><material name="mirror" reflectance=".8" rgba=".2 .2 .2 1"/></asset>
    <worldbody><light pos="0 0 3"/><geom type="sphere" size=".1" pos=".3 .3 .3" rgba="1 0 0 1"/>
      <site name="table" type="box" size=".8 .8 .05" material="mirror"/>
      <site type="sphere" size=".15" pos="-.3 .2 .3" rgba="0 1 0 1"/>
      <camera name="c" pos="0 -2 1.2" xyaxes="1 0 0 0 .5 .9"/></worldbody></mujoco>)");
  const testing::Pair pair(sight({"rgb", "segmentation"}, {0}), m);
  if (!pair.opengl) GTEST_SKIP() << pair.missing;
  EXPECT_LT(pair.other_ids(), 0.01);
  EXPECT_GT(pair.psnr(), 28);
  int green = 0;  // in the mirror image on the table
  const auto rgb = pair.by_rays<std::uint8_t>("rgb");
  const auto ids = pair.by_rays<std::int32_t>("segmentation");
  for (std::size_t i = 0; i < ids.size() / 2; ++i)
    green += ids[2 * i + 1] == mjOBJ_SITE && ids[2 * i] == 0 && rgb[3 * i + 1] > rgb[3 * i] + 60;
  EXPECT_GT(green, 50);
}

}  // namespace
}  // namespace mjsense::sensors
