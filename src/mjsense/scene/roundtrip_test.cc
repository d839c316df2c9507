// SPDX-License-Identifier: Apache-2.0
// The output of to_xml() must compile to the same model: all sizes, names and numbers.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mujoco/mjxmacro.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/scene.h"

namespace mjsense::scene {
namespace {

using ::testing::HasSubstr;

template <class T>
bool near(T a, T b) {
  return a == b || std::abs(static_cast<double>(a) - static_cast<double>(b)) <=
                       1e-9 * (1 + std::abs(static_cast<double>(a)));
}

// Names of the sizes and arrays that differ, with the first values that differ.
std::vector<std::string> differences(const mjModel* a, const mjModel* b) {
  std::vector<std::string> out;
  const auto compare = [&](const char* name, const auto* x, const auto* y, long n) {
    for (long i = 0; i < n; ++i) {
      if (near(x[i], y[i])) continue;
      out.push_back(fmt::format("{}[{}]: {} {}", name, i, static_cast<double>(x[i]),
                                static_cast<double>(y[i])));
      return;
    }
  };
#define X(name) compare(#name, &a->name, &b->name, 1);
  MJMODEL_SIZES
#undef X
  if (!out.empty()) return out;
  MJMODEL_POINTERS_PREAMBLE(a)
  // Sizes that a geom or site type does not use are not saved.
  const auto compare_sizes = [&](const char* name, const int* type, const mjtNum* x,
                                 const mjtNum* y, long n) {
    for (long i = 0; i < n; ++i) {
      const int used = type[i] == mjGEOM_SPHERE                                  ? 1
                       : type[i] == mjGEOM_CAPSULE || type[i] == mjGEOM_CYLINDER ? 2
                                                                                 : 3;
      compare(name, x + 3 * i, y + 3 * i, used);
    }
  };
#define X(type, name, nr, nc)                                                             \
  if (std::string_view(#name) != "geom_size" && std::string_view(#name) != "site_size" && \
      std::string_view(#name) != "tendon_width")                                          \
    compare(#name, a->name, b->name, static_cast<long>(a->nr) * (nc));
#define XNV X
  MJMODEL_POINTERS
#undef XNV
#undef X
  compare_sizes("geom_size", a->geom_type, a->geom_size, b->geom_size, a->ngeom);
  compare_sizes("site_size", a->site_type, a->site_size, b->site_size, a->nsite);
  for (int t = 0; t < a->ntendon; ++t) {  // fixed tendons are not drawn
    if (a->wrap_type[a->tendon_adr[t]] == mjWRAP_JOINT) continue;
    compare("tendon_width", a->tendon_width + t, b->tendon_width + t, 1);
  }
  compare("opt.timestep", &a->opt.timestep, &b->opt.timestep, 1);
  compare("opt.gravity", a->opt.gravity, b->opt.gravity, 3);
  compare("opt.disableflags", &a->opt.disableflags, &b->opt.disableflags, 1);
  compare("opt.enableflags", &a->opt.enableflags, &b->opt.enableflags, 1);
  compare("stat.extent", &a->stat.extent, &b->stat.extent, 1);
  compare("stat.meansize", &a->stat.meansize, &b->stat.meansize, 1);
  compare("vis.headlight.ambient", a->vis.headlight.ambient, b->vis.headlight.ambient, 3);
  compare("vis.global.offwidth", &a->vis.global.offwidth, &b->vis.global.offwidth, 1);
  return out;
}

void expect_round_trip(const Scene& scene) {
  const std::string xml = scene.to_xml();
  Vfs vfs;
  for (const auto& [name, bytes] : scene.assets()) vfs.add(name, bytes, "test");
  char error[1000] = "";
  SpecPtr spec(mj_parseXMLString(xml.c_str(), vfs.get(), error, sizeof error));
  ASSERT_TRUE(spec) << error << "\n" << xml;
  ModelPtr again(mj_compile(spec.get(), vfs.get()));
  ASSERT_TRUE(again) << mjs_getError(spec.get()) << "\n" << xml;
  EXPECT_THAT(differences(scene.model(), again.get()), ::testing::IsEmpty()) << xml;
}

EntityCfg xml(std::string text) { return {.model = {.xml = std::move(text)}}; }

TEST(RoundTrip, PlainEntities) {
  SceneCfg cfg;
  cfg.terrain.emplace();
  cfg.extent = 3;
  cfg.options.disableflags = {"warmstart"};
  cfg.options.enableflags = {"energy"};
  cfg.entities = {
      {"robot",
       xml(R"(<mujoco><compiler angle="degree" eulerseq="zyx"/><default><geom rgba="1 0 0 1"/><default class="d"><joint damping="3"/></default></default>
        <visual><headlight ambient=".3 .2 .1"/><global offwidth="1280"/></visual>
        <worldbody><light pos="0 0 3"/><body pos="0 0 1" euler="10 20 30"><freejoint/><geom size=".1"/><geom type="box" size=".1 .2 .3" pos="1 0 0" euler="0 0 45"/>
        <site name="s"/><camera name="c" resolution="4 4" fovy="30"/>
        <body name="a" pos="0 0 .3"><joint name="j" class="d" range="-30 60" ref="10"/><geom type="capsule" fromto="0 0 0 .1 .2 .3" size=".03"/></body></body></worldbody>
        <actuator><position joint="j" kp="3" ctrlrange="-1 1"/></actuator><sensor><gyro site="s" nsample="3" delay=".004" interval=".01 -.002"/><rangefinder site="s"/><contact data="found force" num="2"/></sensor>
        <keyframe><key name="home" qpos="1 2 3 1 0 0 0 .5" ctrl=".3"/></keyframe></mujoco>)")},
      {"arm",
       xml(R"(<mujoco><compiler angle="radian" autolimits="false"/><worldbody><geom type="plane" size="1 1 1" contype="0"/><body><joint name="j" range="-1 2" limited="true"/><geom size=".1"/>
        <body pos="1 0 0"><joint type="ball"/><geom size=".1"/></body></body></worldbody><tendon><fixed name="t"><joint joint="j" coef="2"/></fixed></tendon>
        <equality><joint joint1="j" polycoef="0 1 0 0 0"/></equality></mujoco>)")},
      {"prop",
       {.model = {.xml = "<mujoco><worldbody><body mocap='true' name='m'><geom "
                         "size='.1'/></body></worldbody></mujoco>"},
        .pos = {1, 2, 3},
        .quat = {1, 1, 0, 0}}},
      {"tree",
       {.model = {.xml = "<mujoco><worldbody><geom name='trunk' size='.1'/></worldbody></mujoco>"},
        .pos = {1, 2, 3},
        .quat = {1, 1, 0, 0},
        .mocap_base = false}}};
  expect_round_trip(Scene(std::move(cfg)));
}

constexpr const char* kSavedObj =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
constexpr const char* kMeshXml =
    "<mujoco><compiler meshdir='meshes'/><asset><mesh name='tet' file='tet.obj' scale='.1 .1 "
    ".1'/><texture name='t' type='2d' builtin='checker' "
    "width='8' height='8'/><material name='m' texture='t'/></asset>"
    "<worldbody><body><freejoint/><geom type='mesh' mesh='tet' "
    "material='m'/></body></worldbody></mujoco>";

TEST(RoundTrip, FilesOnDisk) {
  const testing::TempDir temporary;
  const auto& dir = temporary.path;
  std::filesystem::create_directories(dir / "meshes");
  std::ofstream(dir / "meshes" / "tet.obj") << kSavedObj;
  std::ofstream(dir / "robot.xml") << kMeshXml;
  SceneCfg cfg;
  cfg.entities = {{"a", {.model = {.path = (dir / "robot.xml").string()}}},
                  {"b", {.model = {.path = (dir / "robot.xml").string()}}}};
  expect_round_trip(Scene(std::move(cfg)));
}

TEST(RoundTrip, FilesInMemory) {
  SceneCfg cfg;
  cfg.entities = {{"a", {.model = {.xml = kMeshXml, .assets = {{"meshes/tet.obj", kSavedObj}}}}},
                  {"b", {.model = {.xml = kMeshXml, .assets = {{"meshes/tet.obj", kSavedObj}}}}}};
  expect_round_trip(Scene(std::move(cfg)));
}

// Compiler settings of two entities that one file cannot express.
TEST(RoundTrip, DifferentCompilers) {
  const auto body = [](const char* compiler) {
    return xml(
        fmt::format(R"(<mujoco><compiler {}/><worldbody><body name="b" euler="10 20 30"><freejoint/>
      <inertial pos=".01 .02 .03" mass="2" diaginertia=".01 .02 .025"/><geom size=".1" pos=".3 0 0"/>
      <body><joint name="j" range="-1 1"/><geom type="box" size=".1 .2 .3" group="2" mass="0.01"/></body></body></worldbody></mujoco>)",
                    compiler));
  };
  SceneCfg cfg;
  cfg.entities = {
      {"a", body("inertiafromgeom='true'")},
      {"b", body("balanceinertia='true' angle='radian'")},
      {"c", body("inertiagrouprange='0 3' inertiafromgeom='auto' balanceinertia='true'")},
      {"d", body("settotalmass='7' alignfree='true'")},
      {"e", body("boundmass='.5' boundinertia='.3'")},
      {"f", body("boundmass='.6' fusestatic='true'")}};
  expect_round_trip(Scene(std::move(cfg)));
}

// A model that attaches another one without a prefix, where both have a default class of the same
// name.
TEST(RoundTrip, RepeatedDefaultClasses) {
  const std::string part =
      "<mujoco model='part'><default><default class='robot'><default class='look'><geom rgba='0 1 "
      "0 1' "
      "group='2'/></default></default></default><worldbody><body name='p' pos='0 0 1'><joint "
      "name='j'/>"
      "<geom class='look' size='.1'/><geom class='look' group='3' "
      "size='.1'/></body></worldbody></mujoco>";
  const std::string whole =
      "<mujoco><default><default class='look'><geom rgba='1 0 0 1' size='.3' contype='0'/>"
      "<default class='look_'><geom size='.4'/></default></default></default>"
      "<asset><model name='part' file='part.xml'/></asset><worldbody><body name='own'><freejoint/>"
      "<geom class='look'/><geom class='look_'/><body childclass='look' pos='1 0 0'><geom/><attach "
      "model='part' prefix=''/>"
      "</body></body></worldbody></mujoco>";
  SceneCfg base;
  base.base = {.xml = whole, .assets = {{"part.xml", part}}};
  expect_round_trip(Scene(std::move(base)));
  SceneCfg cfg;
  cfg.entities = {{"a", {.model = {.xml = whole, .assets = {{"part.xml", part}}}}},
                  {"b", {.model = {.xml = whole, .assets = {{"part.xml", part}}}}}};
  const Scene scene(std::move(cfg));
  ASSERT_EQ(scene.model()->ngeom, 10);
  expect_round_trip(scene);
}

// Two entities have different files of the same name.
TEST(RoundTrip, ClashingFiles) {
  const std::string big =
      "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  SceneCfg cfg;
  cfg.entities = {{"a", {.model = {.xml = kMeshXml, .assets = {{"tet.obj", kSavedObj}}}}},
                  {"b", {.model = {.xml = kMeshXml, .assets = {{"tet.obj", big}}}}},
                  {"c", {.model = {.xml = kMeshXml, .assets = {{"tet.obj", big}}}}}};
  Scene scene(std::move(cfg));
  ASSERT_EQ(scene.model()->nmesh, 3);
  EXPECT_NEAR(scene.model()->body_mass[2] / scene.model()->body_mass[1], 8, 1e-5);
  EXPECT_NEAR(scene.model()->body_mass[3] / scene.model()->body_mass[1], 8, 1e-5);
  expect_round_trip(scene);
}

TEST(RoundTrip, GeneratedTerrain) {
  SceneCfg cfg;
  cfg.terrain = TerrainCfg{.terrain_type = "generator", .levels = 2};
  cfg.entities = {
      {"a",
       xml("<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")}};
  expect_round_trip(Scene(std::move(cfg)));
}

}  // namespace
}  // namespace mjsense::scene
