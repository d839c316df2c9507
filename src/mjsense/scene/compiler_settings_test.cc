// SPDX-License-Identifier: Apache-2.0
// For every setting of <compiler>: a model attached to a scene must equal the model compiled alone,
// and so must the output of to_xml().

#include "mjsense/scene/compiler_settings.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <ostream>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/scene/scene.h"

namespace mjsense::scene {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::ThrowsMessage;

constexpr const char* kObj =
    "v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";

// A floating base with a welded head, a light arm with a muscle, visual geoms, a mesh and a box
// fitted to it. The inertias of the arm and the tip need balancing only if the setting causes it.
std::string robot(const std::string& compiler) {
  return fmt::format(R"(<mujoco><compiler {}/>
    <option timestep=".01"/>
    <default><joint damping=".1"/><default class="thin"><geom rgba="1 0 0 1"/></default></default>
    <asset><mesh name="tet" file="sub/tet.obj" scale=".1 .1 .1"/><mesh name="looks" file="sub/tet.obj" scale=".2 .1 .1"/>
      <texture name="t" type="2d" builtin="checker" width="8" height="8"/><material name="m" texture="t"/></asset>
    <worldbody><body name="base" pos="0 0 1" euler="10 20 30"><freejoint name="root"/>
      <geom name="b0" size=".1" class="thin"/>
      <geom name="b1" type="box" size=".1 .2 .3" pos=".3 .1 0" group="3" contype="0" conaffinity="0" material="m"/>
      <body name="head" pos=".1 0 .2" euler="5 6 7"><geom name="h0" size=".05"/><site name="s" pos=".1 0 0"/>
        <geom name="h1" type="mesh" mesh="looks" contype="0" conaffinity="0" mass="0"/>
        <frame pos=".1 .2 .3" euler="0 0 90"><geom name="h2" type="box" mesh="tet" pos="0 .1 0"/></frame>
        <body name="arm" pos="0 0 .3"><joint name="j" range="-30 60" springdamper=".2 1"/>
          <inertial mass="1e-4" pos="0 0 .1" euler="0 10 0" diaginertia="2e-6 3e-6 4e-6"/>
          <geom name="a0" type="capsule" fromto="0 0 0 .1 .2 .3" size=".03" mass=".2"/>
          <body name="tip" pos="0 0 .1"><joint name="k" type="slide" range="-.1 .1"/><geom name="t0" type="mesh" mesh="tet"/></body>
        </body></body></body>
      <body name="puck" pos="2 0 0"><joint name="p" type="slide"/><geom name="p0" size=".02" pos=".1 0 0"/></body></worldbody>
    <actuator><muscle name="u" joint="j"/><motor name="v" joint="k" gear="2"/></actuator>
    <keyframe><key qpos="0 0 1 1 0 0 0 .1 .2 .3"/></keyframe></mujoco>)",
                     compiler);
}

const std::map<std::string, std::string> kAssets = {{"sub/tet.obj", kObj}};

ModelPtr compile_text(const std::string& xml, const std::map<std::string, std::string>& assets) {
  Vfs vfs;
  for (const auto& [name, bytes] : assets) vfs.add(name, bytes, "test");
  char error[1000] = "";
  SpecPtr spec(mj_parseXMLString(xml.c_str(), vfs.get(), error, sizeof error));
  EXPECT_TRUE(spec) << error;
  if (!spec) return nullptr;
  ModelPtr model(mj_compile(spec.get(), vfs.get()));
  EXPECT_TRUE(model) << mjs_getError(spec.get());
  return model;
}

// Compares elements `name` of one model with elements prefix + name of the other.
struct Compare {
  const mjModel* alone;
  const mjModel* scene;
  std::string prefix;
  double tolerance;  // relative
  int compared = 0;

  void numbers(const char* field, mjtObj type, int dim, const mjtNum* a, const mjtNum* b,
               double limit) {
    const int n = type == mjOBJ_BODY       ? alone->nbody
                  : type == mjOBJ_GEOM     ? alone->ngeom
                  : type == mjOBJ_SITE     ? alone->nsite
                  : type == mjOBJ_ACTUATOR ? alone->nactuator
                                           : alone->njnt;
    for (int i = type == mjOBJ_BODY ? 1 : 0; i < n; ++i) {
      const char* name = mj_id2name(alone, type, i);
      if (!name || !*name) continue;
      const int other = mj_name2id(scene, type, (prefix + name).c_str());
      ASSERT_GE(other, 0) << name << " is not in the scene";
      double distance = 0, opposite = 0, size = 0;
      for (int k = 0; k < dim; ++k) {
        distance = std::max(distance, std::abs(a[dim * i + k] - b[dim * other + k]));
        opposite = std::max(opposite, std::abs(a[dim * i + k] + b[dim * other + k]));
        size = std::max(size, std::abs(a[dim * i + k]));
      }
      if (dim == 4) distance = std::min(distance, opposite);
      EXPECT_LE(distance, limit * size) << field << " of " << name << ": " << a[dim * i];
      ++compared;
    }
  }

  void run() {
    const auto count = [&](mjtObj type, int n) {
      int found = 0;
      for (int i = 0; i < n; ++i) {
        const char* name = mj_id2name(scene, type, i);
        found += name && std::string_view(name).starts_with(prefix) &&
                 std::string_view(name) != prefix + "mocap_base";
      }
      return found;
    };
    int textures = 0;  // the sky texture may be unnamed
    for (int i = 0; i < alone->ntex; ++i)
      textures += mj_id2name(alone, mjOBJ_TEXTURE, i) != nullptr;
    EXPECT_EQ(count(mjOBJ_BODY, scene->nbody), alone->nbody - 1);
    EXPECT_EQ(count(mjOBJ_GEOM, scene->ngeom), alone->ngeom);
    EXPECT_EQ(count(mjOBJ_MESH, scene->nmesh), alone->nmesh);
    EXPECT_EQ(count(mjOBJ_MATERIAL, scene->nmat), alone->nmat);
    EXPECT_EQ(count(mjOBJ_TEXTURE, scene->ntex), textures);
    // Tolerances for values computed with the scene's mass matrix and by simulating the scene.
    const double solved = std::max(tolerance, 1e-12), simulated = std::max(tolerance, 1e-6);
#define FIELD(type, name, dim) numbers(#name, type, dim, alone->name, scene->name, tolerance)
    numbers("body_mass", mjOBJ_BODY, 1, alone->body_mass, scene->body_mass, 0);
    FIELD(mjOBJ_BODY, body_subtreemass, 1);
    numbers("body_inertia", mjOBJ_BODY, 3, alone->body_inertia, scene->body_inertia, 0);
    FIELD(mjOBJ_BODY, body_ipos, 3);
    FIELD(mjOBJ_BODY, body_iquat, 4);
    FIELD(mjOBJ_BODY, body_pos, 3);
    FIELD(mjOBJ_BODY, body_quat, 4);
    FIELD(mjOBJ_GEOM, geom_size, 3);
    FIELD(mjOBJ_GEOM, geom_pos, 3);
    FIELD(mjOBJ_GEOM, geom_quat, 4);
    FIELD(mjOBJ_SITE, site_pos, 3);
    FIELD(mjOBJ_SITE, site_quat, 4);
    FIELD(mjOBJ_JOINT, jnt_range, 2);
    FIELD(mjOBJ_JOINT, jnt_stiffness, 1);
    numbers("actuator_lengthrange", mjOBJ_ACTUATOR, 2, alone->actuator_lengthrange,
            scene->actuator_lengthrange, simulated);
    numbers("actuator_acc0", mjOBJ_ACTUATOR, 1, alone->actuator_acc0, scene->actuator_acc0, solved);
#undef FIELD
    for (int j = 0; j < alone->njnt; ++j) {
      const char* name = mj_id2name(alone, mjOBJ_JOINT, j);
      if (!name || !*name) continue;
      const int other = mj_name2id(scene, mjOBJ_JOINT, (prefix + name).c_str());
      EXPECT_EQ(alone->jnt_limited[j], scene->jnt_limited[other]) << name;
      EXPECT_NEAR(alone->dof_damping[alone->jnt_dofadr[j]],
                  scene->dof_damping[scene->jnt_dofadr[other]],
                  tolerance * alone->dof_damping[alone->jnt_dofadr[j]])
          << name;
    }
    for (int g = 0; g < alone->ngeom; ++g) {
      const char* name = mj_id2name(alone, mjOBJ_GEOM, g);
      if (!name || !*name) continue;
      const int other = mj_name2id(scene, mjOBJ_GEOM, (prefix + name).c_str());
      ASSERT_GE(other, 0);
      EXPECT_EQ(alone->geom_type[g], scene->geom_type[other]) << name;
      EXPECT_EQ(alone->geom_matid[g] < 0, scene->geom_matid[other] < 0) << name;
    }
  }
};

struct Setting {
  const char* text;
  bool exact;  // MuJoCo attaches it unchanged; all numbers must be equal
};

void PrintTo(const Setting& setting, std::ostream* out) { *out << setting.text; }

class CompilerSettings : public ::testing::TestWithParam<Setting> {};

TEST_P(CompilerSettings, EntityEqualsTheModelAlone) {
  const std::string xml = robot(GetParam().text);
  const ModelPtr alone = compile_text(xml, kAssets);
  ASSERT_TRUE(alone);
  SceneCfg cfg;
  cfg.terrain = TerrainCfg{};
  cfg.entities = {{"plain", {.model = {.xml = robot(""), .assets = kAssets}}},
                  {"e", {.model = {.xml = xml, .assets = kAssets}}},
                  {"f", {.model = {.xml = xml, .assets = kAssets}}}};
  const Scene scene(std::move(cfg));
  const ModelPtr saved = compile_text(scene.to_xml(), scene.assets()),
                 plain = compile_text(robot(""), kAssets);
  ASSERT_TRUE(saved);
  const double exact = GetParam().exact ? 0 : 1e-9;
  for (const char* prefix : {"e/", "f/"}) {
    SCOPED_TRACE(prefix);
    Compare{alone.get(), scene.model(), prefix, exact}.run();
    Compare{alone.get(), saved.get(), prefix, 1e-9}.run();
  }
  SCOPED_TRACE("plain/");
  Compare{plain.get(), scene.model(), "plain/", 1e-12}.run();
  Compare{plain.get(), saved.get(), "plain/", 1e-9}.run();
  EXPECT_EQ(scene.model()->key_qpos[scene.model()->nq - 1], .3);
}

INSTANTIATE_TEST_SUITE_P(
    Each, CompilerSettings,
    ::testing::Values(
        Setting{"angle='radian'", true}, Setting{"eulerseq='zyx'", true},
        Setting{"boundmass='.5'", true}, Setting{"boundinertia='.01'", true},
        Setting{"balanceinertia='true' boundinertia='3.5e-6'", true},
        Setting{"inertiafromgeom='true'", true}, Setting{"inertiagrouprange='0 2'", true},
        Setting{"inertiafromgeom='true' inertiagrouprange='0 0'", true},
        Setting{"alignfree='true'", true}, Setting{"usethread='false'", true},
        Setting{"saveinertial='true'", true}, Setting{"conflict='error'", true},
        Setting{"meshdir='sub/..'", true}, Setting{"assetdir='.'", true},
        Setting{"settotalmass='7'", false}, Setting{"fusestatic='true'", false},
        Setting{"discardvisual='true'", false}, Setting{"fitaabb='true'", false},
        Setting{"settotalmass='7' boundmass='.5' inertiafromgeom='true'", false},
        Setting{"settotalmass='.01' boundmass='.5' boundinertia='.01'", false},
        Setting{"settotalmass='3' fusestatic='true' discardvisual='true' fitaabb='true'", false},
        Setting{"fusestatic='true' inertiagrouprange='0 2' alignfree='true' angle='radian'",
                false}));

std::string with_lengthrange(const std::string& attributes) {
  std::string xml = robot("");
  const std::string tag = "<compiler />";
  return xml.replace(xml.find(tag), tag.size(),
                     fmt::format("<compiler><lengthrange {}/></compiler>", attributes));
}

TEST(CompilerSettings, LengthRangesEqualTheModelAlone) {
  for (const char* attributes :
       {"mode='all' uselimit='true'", "uselimit='true'", "accel='5' inttotal='20'"}) {
    SCOPED_TRACE(attributes);
    const std::string xml = with_lengthrange(attributes);
    const ModelPtr alone = compile_text(xml, kAssets);
    SceneCfg cfg;
    cfg.entities = {{"plain", {.model = {.xml = robot(""), .assets = kAssets}}},
                    {"e", {.model = {.xml = xml, .assets = kAssets}}}};
    const Scene scene(std::move(cfg));
    Compare{alone.get(), scene.model(), "e/", 1e-9}.run();
    Compare{alone.get(), compile_text(scene.to_xml(), scene.assets()).get(), "e/", 1e-9}.run();
  }
  const auto make = [](const std::string& xml) {
    SceneCfg cfg;
    cfg.entities = {{"e", {.model = {.xml = xml, .assets = kAssets}}}};
    return Scene(std::move(cfg)).model()->nu;
  };
  EXPECT_THAT([&] { make(with_lengthrange("mode='none'")); },
              ThrowsMessage<ValueError>(HasSubstr("entity 'e': <lengthrange mode='none'> leaves "
                                                  "muscle 'u' without a range")));
}

// The defaults of URDF are fusestatic and discardvisual.
TEST(CompilerSettings, Urdf) {
  const std::string inertial =
      "<inertial><origin xyz='0 0 .1'/><mass value='2'/><inertia ixx='.02' iyy='.03' izz='.04' "
      "ixy='0' "
      "ixz='0' iyz='0'/></inertial><collision><geometry><box size='.1 .2 "
      ".3'/></geometry></collision>";
  const std::string urdf = fmt::format(
      "<robot name='r'><link name='base'>{0}</link><link name='arm'>{0}</link><link "
      "name='hand'>{0}</link>"
      "<joint name='j' type='revolute'><parent link='base'/><child link='arm'/><origin xyz='0 0 "
      ".3'/><axis "
      "xyz='0 1 0'/><limit lower='-1' upper='2' effort='5' velocity='3'/></joint>"
      "<joint name='fixed' type='fixed'><parent link='arm'/><child link='hand'/><origin xyz='0 .1 "
      ".3' rpy='.1 "
      ".2 .3'/></joint></robot>",
      inertial);
  const ModelPtr alone = compile_text(urdf, {});
  ASSERT_TRUE(alone);
  ASSERT_EQ(alone->nbody, 2);
  SceneCfg cfg;
  cfg.entities = {{"e", {.model = {.xml = urdf}}},
                  {"f", {.model = {.xml = urdf}, .mocap_base = false}}};
  const Scene scene(std::move(cfg));
  for (const char* prefix : {"e/", "f/"}) {
    SCOPED_TRACE(prefix);
    Compare{alone.get(), scene.model(), prefix, 1e-9}.run();
    Compare{alone.get(), compile_text(scene.to_xml(), scene.assets()).get(), prefix, 1e-9}.run();
  }
}

TEST(CompilerSettings, InapplicableSettingsThrow) {
  const auto make = [](const mjSpec* spec) {
    SceneCfg cfg;
    cfg.entities = {{"e", {.model = {.spec = spec}}}};
    return Scene(std::move(cfg)).model()->ntex;
  };
  const SpecPtr spec(mj_makeSpec());
  mjsTexture* texture = mjs_addTexture(spec.get(), nullptr);
  mjs_setName(texture->element, "t");
  texture->type = mjTEXTURE_2D;
  texture->width = texture->height = 2;
  texture->nchannel = 3;
  const unsigned char pixels[12] = {};
  mjs_setBuffer(texture->data, pixels, 12);
  EXPECT_EQ(make(spec.get()), 1);
  spec->compiler.settotalmass = 7;
  EXPECT_THAT(
      [&] { make(spec.get()); },
      ThrowsMessage<Error>(::testing::AllOf(
          HasSubstr("entity 'e': compiled by itself, because its <compiler> sets settotalmass"),
          HasSubstr("no support for buffer textures"))));
}

// <visual> settings are taken from the first entity that sets them, even to MuJoCo's default
// values.
TEST(CompilerSettings, ExplicitDefaultVisualSettingsAreUsed) {
  const auto lit = [](const char* compiler, double ambient) {
    return fmt::format(R"(<mujoco><compiler {}/><visual><headlight ambient="{} .1 .1"/></visual>
        <worldbody><body name="b"><geom size=".1"/></body></worldbody></mujoco>)",
                       compiler, ambient);
  };
  SceneCfg cfg;
  cfg.entities = {{"first", {.model = {.xml = lit("fusestatic='true'", .1)}}},
                  {"second", {.model = {.xml = lit("", .5)}}}};
  EXPECT_FLOAT_EQ(Scene(std::move(cfg)).model()->vis.headlight.ambient[0], .1f);
}

TEST(CompilerSettings, SettingsOfTheBaseDoNotAffectEntities) {
  const auto scene = [](const std::string& compiler, bool alone) {
    SceneCfg cfg;
    cfg.base = {.xml = robot(compiler), .assets = kAssets};
    if (!alone) cfg.entities = {{"e", {.model = {.xml = robot(""), .assets = kAssets}}}};
    const Scene scene(std::move(cfg));
    return scene.model()->body_subtreemass[0];
  };
  EXPECT_NEAR(scene("settotalmass='7'", true), 7, 1e-12);
  for (const char* setting : {"settotalmass", "fusestatic", "discardvisual", "fitaabb"}) {
    EXPECT_THAT(
        [&] { scene(fmt::format("{}='{}'", setting, setting[0] == 's' ? "7" : "true"), false); },
        ThrowsMessage<ValueError>(HasSubstr(fmt::format(
            "scene base: its <compiler> sets {}, which would also affect the attached entities",
            setting))));
  }
  // Bounds apply to the base's own bodies only.
  const double plain = compile_text(robot(""), kAssets)->body_subtreemass[0],
               bounded = compile_text(robot("boundmass='.5'"), kAssets)->body_subtreemass[0];
  EXPECT_GT(bounded, plain + .5);
  EXPECT_NEAR(scene("boundmass='.5'", false), plain + bounded, 1e-9);
}

TEST(CompilerSettings, OnlyEffectiveSettingsAreApplied) {
  const auto settings = [](const std::string& xml) {
    char error[1000] = "";
    const SpecPtr spec(mj_parseXMLString(xml.c_str(), nullptr, error, sizeof error));
    EXPECT_TRUE(spec) << error;
    return whole_model_settings(spec.get());
  };
  EXPECT_THAT(settings(robot("")), IsEmpty());
  EXPECT_THAT(settings(robot("settotalmass='-1' boundmass='1' alignfree='true'")), IsEmpty());
  EXPECT_THAT(settings(robot("settotalmass='1' fusestatic='true' fitaabb='true'")),
              ElementsAre("settotalmass", "fusestatic", "fitaabb"));
  EXPECT_THAT(
      settings("<mujoco><compiler fitaabb='true'><lengthrange mode='all'/></compiler><worldbody>"
               "<geom size='1'/></worldbody></mujoco>"),
      IsEmpty());
}

}  // namespace
}  // namespace mjsense::scene
