// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/episode_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <functional>
#include <numbers>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense_tasks/scenes/load_scene.h"

namespace mjsense::tasks::scenes {
namespace {

using ::testing::HasSubstr;

constexpr char kRoom[] = R"(
<mujoco>
  <asset>
    <texture name="oak" type="2d" builtin="flat" rgb1="1 0 0" width="4" height="4"/>
    <texture name="oak_normals" type="2d" builtin="flat" rgb1=".5 .5 1" width="4" height="4"/>
    <texture name="sky" type="2d" builtin="flat" rgb1=".5 .5 1" width="4" height="4"/>
    <texture name="around" type="cube" builtin="flat" rgb1="1 1 1" width="4" height="4"/>
    <texture name="ash" type="2d" builtin="flat" rgb1="0 1 0" width="4" height="4"/>
    <material name="top" texture="oak" rgba=".8 .6 .4 1"/>
  </asset>
  <worldbody>
    <light name="around" type="image" texture="around" intensity="300"/>
    <light name="lamp" pos="0 0 3" dir="0 0 -1" diffuse=".5 .5 .5"/>
    <geom type="plane" size="2 2 .1"/>
    <body name="table" pos="1 0 0"><geom name="top" type="box" size=".5 .4 .01" pos="0 0 .5" material="top"/></body>
    <body name="shelf" pos="0 1 0"><geom name="board" type="box" size=".3 .2 .01" pos="0 0 1"/></body>
  </worldbody>
</mujoco>)";

std::string object(const char* name, const char* geom) {
  return std::string("<mujoco><worldbody><body name=\"") + name + "\"><freejoint/>" + geom +
         "</body></worldbody></mujoco>";
}

// Files of a scene with two cubes, a can and a wardrobe.
struct Files {
  testing::TempDir dir;
  SceneFileCfg cfg;

  Files() {
    write("room.xml", kRoom);
    write("cube.xml", object("cube", R"(<geom type="box" size=".02 .02 .02"/>)"));
    write("can.xml", object("can", R"(<geom type="cylinder" size=".03 .05"/>)"));
    write("wardrobe.xml", object("wardrobe", R"(<geom type="box" size=".3 .3 .9" pos="0 0 .9"/>)"));
    cfg.name = "two_tables";
    cfg.entities = {{"room", dir.file("room.xml")},
                    {"a", dir.file("cube.xml"), {0, 0, .2}},
                    {"b", dir.file("cube.xml"), {.2, 0, .2}},
                    {"c", dir.file("can.xml"), {.4, 0, .2}},
                    {"w", dir.file("wardrobe.xml"), {-1, -1, 0}}};
    cfg.regions = {{"table", "room/top"}};
  }
  void write(const char* name, const std::string& text) const {
    std::ofstream(dir.path / name) << text;
  }
};

// The scene's simulation, without a robot.
struct Played {
  EpisodeScene scene;
  std::shared_ptr<sim::Simulation> sim;

  explicit Played(SceneFileCfg cfg, int worlds = 1) : scene(std::move(cfg)) {
    scene::SceneCfg whole = scene.scene_cfg("robot_0");
    std::erase_if(whole.entities, [](const auto& entity) { return entity.first == "robot_0"; });
    sim = std::make_shared<sim::Simulation>(std::make_shared<scene::Scene>(whole),
                                            sim::SimulationCfg{.num_worlds = worlds});
    scene.initialize(sim->model(), worlds, "robot_0/");
    scene.bind(*sim);
  }
  Pose start(std::uint64_t episode, int target = 0, int world = 0) {
    Rng rng(3, 0, stream_of("places"), episode);
    if (scene.vary(world, 3, episode)) sim->worlds().model_changed();
    const Pose base =
        scene.sample(world, target, 3, episode, rng, robots::state_row(sim->worlds(), world));
    sim->forward();
    return base;
  }
  Vec3 at(int object, int world = 0) const {
    const mjModel* m = sim->model();
    const double* qpos = robots::state_row(sim->worlds(), world).qpos;
    return vec3(qpos + m->jnt_qposadr[m->body_jntadr[scene.objects()[object].body]]);
  }
  std::string fault() const {
    std::string found;
    struct Hooks final : worlds::WorldHooks {
      std::function<void(const World&)> body;
      void substep(const World& /*world*/) override {}
      void reset(const World& /*world*/) override {}
      void refreshed(const World& world) override { body(world); }
    } hooks;
    hooks.body = [&](const World& world) { found = scene.fault(world); };
    sim->worlds().visit(worlds::all_worlds, hooks);
    return found;
  }
};

TEST(EpisodeScene, GraspableBodiesAreObjects) {
  const Files files;
  Played played(files.cfg);
  std::vector<std::string> kinds;
  for (const SceneObject& o : played.scene.objects()) kinds.push_back(o.kind);
  EXPECT_THAT(kinds, ::testing::ElementsAre("cube", "cube", "can"));  // not the wardrobe
}

TEST(EpisodeScene, ModelWithoutJointGetsAFreeJoint) {
  Files files;
  files.write("block.xml",
              "<mujoco><worldbody><body><body><geom type='box' size='.02 .02 .03'/>"
              "</body></body></worldbody></mujoco>");
  files.cfg.entities.push_back({"block", files.dir.file("block.xml"), {}, {1, 0, 0, 0}, true});
  Played played(files.cfg);
  ASSERT_EQ(played.scene.objects().size(), 4u);
  EXPECT_EQ(played.scene.objects()[3].kind, "block");
  played.start(0, 3);
  EXPECT_NEAR(played.at(3).z, .5403, 1e-9);
  files.cfg.entities.back().model = files.dir.file("cube.xml");
  EXPECT_THROW(EpisodeScene{files.cfg}, ValueError);
}

TEST(EpisodeScene, ObjectsAreOnTheSurfaceWithoutCollisions) {
  Files files;
  files.cfg.regions[0].target_area = std::array<double, 4>{.9, 1.1, -.1, .1};
  Played played(files.cfg);
  for (std::uint64_t episode = 0; episode < 50; ++episode) {
    played.start(episode, 2);
    EXPECT_EQ(played.fault(), "") << episode;
    for (int i = 0; i < 3; ++i) {
      const Vec3 p = played.at(i);
      EXPECT_NEAR(p.z, .51 + (i == 2 ? .05 : .02) + .0003, 1e-9);
      EXPECT_LE(std::abs(p.x - 1), i == 2 ? .1 : .5);
      EXPECT_LE(std::abs(p.y), i == 2 ? .1 : .4);
      for (int k = 0; k < i; ++k) {
        const Vec3 d = p - played.at(k);
        const double radii = (i == 2 ? .03 : .02 * std::sqrt(2)) + .02 * std::sqrt(2);
        EXPECT_GE(std::hypot(d.x, d.y), radii + (i == 2 ? .07 : .02) - 1e-6);
      }
    }
  }
}

TEST(EpisodeScene, StartDependsOnSeedAndEpisodeOnly) {
  Files files;
  files.cfg.robot.pos_spread = {.1, .2};
  files.cfg.robot.yaw_spread = 30;
  Played one(files.cfg), three(files.cfg, 3);
  const Pose base = one.start(7), other = three.start(7, 0, 2);
  EXPECT_EQ(one.at(1).x, three.at(1, 2).x);
  EXPECT_EQ(base.p.y, other.p.y);
  EXPECT_NE(base.p.y, 0);
  EXPECT_LE(std::abs(base.p.x), .1);
  EXPECT_LE(std::abs(base.p.y), .2);
  EXPECT_LE(angle_between(base.q, {}), std::numbers::pi / 6);
  one.start(8);
  EXPECT_NE(one.at(1).x, three.at(1, 2).x);
}

// The pedestal is above the floor; a plinth of the same width must reach down to the floor.
TEST(EpisodeScene, RaisedPedestalGetsAPlinth) {
  Files files;
  files.write("robot.xml", R"(<mujoco><worldbody><body name="base" mocap="true">
      <geom name="pedestal" type="box" size=".2 .1 .3" pos="0 .05 .3" contype="2" group="2"/>
      <geom name="lid" type="box" size=".2 .2 .01" pos="0 0 .59"/>
    </body></worldbody></mujoco>)");
  const auto model = [&](double z) {
    files.cfg.robot.pos = {0, 0, z};
    scene::SceneCfg whole = EpisodeScene(files.cfg).scene_cfg("robot_0");
    for (auto& [name, entity] : whole.entities) {
      if (name == "robot_0") entity.model.path = files.dir.file("robot.xml");
    }
    return scene::Scene(whole);
  };
  const scene::Scene on_floor = model(0), raised = model(.22);
  const mjModel* m = raised.model();
  ASSERT_EQ(m->ngeom, on_floor.model()->ngeom + 1);
  const int base = mj_name2id(m, mjOBJ_BODY, "robot_0/base");
  ASSERT_EQ(m->body_geomnum[base], 3);
  const int plinth = m->body_geomadr[base] + 2;
  EXPECT_NEAR(m->geom_pos[3 * plinth + 1], .05, 1e-12);
  EXPECT_NEAR(m->geom_pos[3 * plinth + 2], -.11, 1e-12);
  EXPECT_NEAR(m->geom_size[3 * plinth], .2, 1e-12);
  EXPECT_NEAR(m->geom_size[3 * plinth + 1], .1, 1e-12);
  EXPECT_NEAR(m->geom_size[3 * plinth + 2], .11, 1e-12);
  EXPECT_EQ(m->geom_contype[plinth], 2);
  EXPECT_EQ(m->geom_group[plinth], 2);
}

// The scene's sky must be used, not that of a model in the scene.
TEST(EpisodeScene, SkyOfTheSceneOverridesModels) {
  Files files;
  files.write("wardrobe.xml", R"(<mujoco>
    <asset><texture type="skybox" builtin="flat" rgb1="1 0 0" rgb2="1 0 0" width="8" height="48"/></asset>
    <worldbody><body name="wardrobe"><geom size=".1"/></body></worldbody></mujoco>)");
  files.cfg.sky = SceneSkyCfg{.top = {0, 1, 0}, .bottom = {0, 1, 0}};
  const Played played(files.cfg);
  const mjModel* m = played.sim->model();
  int skies = 0;
  for (int i = 0; i < m->ntex; ++i) {
    if (m->tex_type[i] != mjTEXTURE_SKYBOX) continue;
    ++skies;
    EXPECT_EQ(m->tex_data[m->tex_adr[i]], 0);
    EXPECT_EQ(m->tex_data[m->tex_adr[i] + 1], 255);
  }
  EXPECT_EQ(skies, 1);
}

TEST(EpisodeScene, GeneratedScenesHaveASky) {
  SceneFileCfg cfg;
  cfg.name = "street";
  cfg.generator = "kitchen";
  const Played played(cfg);
  const mjModel* m = played.sim->model();
  EXPECT_EQ(std::count(m->tex_type, m->tex_type + m->ntex, mjTEXTURE_SKYBOX), 1);
}

TEST(EpisodeScene, PlacesTheConfiguredNumberOfObjects) {
  Files files;
  files.cfg.count = {1, 2};
  Played played(files.cfg);
  std::set<int> counts, companions;
  for (std::uint64_t episode = 0; episode < 60; ++episode) {
    played.start(episode, 1);
    EXPECT_TRUE(played.scene.present(0, 1));
    int count = 0;
    for (int i = 0; i < 3; ++i) {
      const bool there = played.scene.present(0, i);
      count += there;
      if (there) companions.insert(i);
      EXPECT_EQ(there, played.at(i).x < 10);
    }
    counts.insert(count);
  }
  EXPECT_THAT(counts, ::testing::ElementsAre(1, 2));
  EXPECT_THAT(companions, ::testing::ElementsAre(0, 1, 2));
}

TEST(EpisodeScene, SeveralSurfacesAreAllUsed) {
  Files files;
  files.cfg.regions.push_back({"shelf", "room/board"});
  Played played(files.cfg);
  std::set<long> heights;
  for (std::uint64_t episode = 0; episode < 20; ++episode) {
    played.start(episode);
    EXPECT_EQ(played.fault(), "");
    EXPECT_NEAR(played.scene.support_height(0), played.at(0).z - .0203, 1e-9);
    heights.insert(std::lround(100 * played.at(0).z));
  }
  EXPECT_THAT(heights, ::testing::ElementsAre(53, 103));
}

// A table of rotated boxes, none with its z axis up, and without names.
TEST(EpisodeScene, RegionCanBeABody) {
  Files files;
  files.write(
      "desk.xml",
      R"(<mujoco><worldbody><body name="desk" pos="0 -1 0"><body name="frame" euler="0 0 90">
    <geom type="box" size=".02 .2 .4" pos="0 0 .7" euler="0 90 0"/>
    <geom type="box" size=".02 .2 .1" pos=".5 0 .7" euler="0 90 0"/>
    <geom type="box" size=".02 .3 .02" pos="0 0 .35"/></body></body></worldbody></mujoco>)");
  files.cfg.entities.push_back({"work", files.dir.file("desk.xml")});
  files.cfg.regions = {{"desk", "work/desk"}};
  Played played(files.cfg);
  for (std::uint64_t episode = 0; episode < 20; ++episode) {
    played.start(episode);
    EXPECT_EQ(played.fault(), "");
    EXPECT_NEAR(played.at(0).z, .72 + .0203, 1e-9);
    EXPECT_LT(std::abs(played.at(0).x), .2) << "the larger of two as high";
    EXPECT_LT(std::abs(played.at(0).y + 1), .4);
  }
}

TEST(EpisodeScene, FreeEntityThatIsNotPlacedThrows) {
  Files files;
  files.write(
      "sofa.xml",
      R"(<mujoco><worldbody><body name="sofa"><geom type="box" size=".5 .9 .4"/></body></worldbody></mujoco>)");
  files.cfg.entities.push_back({.name = "sofa", .model = files.dir.file("sofa.xml"), .free = true});
  EXPECT_THAT(error_of<ValueError>([&] { Played played(files.cfg); }),
              HasSubstr("scene 'two_tables': entity 'sofa' is not graspable"));
  files.cfg.entities.back().pos = {-2, -2, .4};
  EXPECT_NO_THROW(Played played(files.cfg));
}

TEST(EpisodeScene, PenetrationAtTheStartIsReported) {
  Files files;
  Played played(files.cfg);
  played.start(0);
  const mjModel* m = played.sim->model();
  double* qpos = robots::state_row(played.sim->worlds(), 0).qpos;
  qpos[m->jnt_qposadr[m->body_jntadr[played.scene.objects()[0].body]] + 2] -= .01;
  played.sim->forward();
  EXPECT_THAT(played.fault(),
              HasSubstr("scene 'two_tables': 'cube' starts 9.7 mm inside 'room/table'"));
}

TEST(EpisodeScene, VariationIsBoundedAndDependsOnTheEpisodeOnly) {
  Files files;
  SceneVaryCfg lamp, top;
  lamp.what = VaryKind::kLight;
  lamp.pattern = "room/.*";
  lamp.brightness = {.5, 1.5};
  lamp.pos = {.2, 0, 0};
  lamp.angle = 10;
  top.what = VaryKind::kMaterial;
  top.pattern = "room/top";
  top.hue = 20;
  top.textures = {"room/oak", "room/ash"};
  files.cfg.vary = {lamp, top};
  Played played(files.cfg, 2);
  mjBatch* batch = played.sim->worlds().batch();
  const mjModel* m = played.sim->model();
  const int light = mj_name2id(m, mjOBJ_LIGHT, "room/lamp");
  const int material = mj_name2id(m, mjOBJ_MATERIAL, "room/top");
  std::set<int> textures;
  for (std::uint64_t episode = 0; episode < 40; ++episode) {
    played.start(episode, 0, 0);
    played.start(episode, 0, 1);
    const auto* pos =
        static_cast<const double*>(mjb_expanded(batch, "light_pos", nullptr, nullptr));
    const auto* dir =
        static_cast<const double*>(mjb_expanded(batch, "light_dir", nullptr, nullptr));
    const auto* diffuse =
        static_cast<const float*>(mjb_expanded(batch, "light_diffuse", nullptr, nullptr));
    const auto* rgba = static_cast<const float*>(mjb_expanded(batch, "mat_rgba", nullptr, nullptr));
    const auto* texture =
        static_cast<const int*>(mjb_expanded(batch, "mat_texid", nullptr, nullptr));
    ASSERT_TRUE(pos && dir && diffuse && rgba && texture);
    for (int w = 0; w < 2; ++w) {
      const double* p = pos + 3 * (w * m->nlight + light);
      EXPECT_LE(std::abs(p[0]), .2);
      EXPECT_EQ(p[1], 0);
      EXPECT_EQ(p[0], pos[3 * light]);
      const Vec3 d = vec3(dir + 3 * (w * m->nlight + light));
      EXPECT_NEAR(norm(d), 1, 1e-12);
      EXPECT_GE(-d.z, std::cos(10 * std::numbers::pi / 180) - 1e-12);
      const float* colour = diffuse + 3 * (w * m->nlight + light);
      EXPECT_GE(colour[0], .25f);
      EXPECT_LE(colour[0], .75f);
      EXPECT_FLOAT_EQ(colour[0], colour[2]);  // grey stays grey
      const float* brown = rgba + 4 * (w * m->nmat + material);
      EXPECT_FLOAT_EQ(std::max({brown[0], brown[1], brown[2]}), .8f);
      const int* roles = texture + mjNTEXROLE * (w * m->nmat + material);
      textures.insert(roles[mjTEXROLE_RGB]);
      const bool oak = roles[mjTEXROLE_RGB] == mj_name2id(m, mjOBJ_TEXTURE, "room/oak");
      EXPECT_EQ(roles[mjTEXROLE_NORMAL],
                oak ? mj_name2id(m, mjOBJ_TEXTURE, "room/oak_normals") : -1);
    }
  }
  EXPECT_EQ(textures.size(), 2u);
}

// Classic images have no image lights, so their episodes must not depend on them.
TEST(EpisodeScene, ImageLightsDrawNumbersOfTheirOwn) {
  std::vector<float> found;
  for (const char* pattern : {"room/lamp", "room/.*"}) {
    Files files;
    SceneVaryCfg lamp;
    lamp.what = VaryKind::kLight;
    lamp.pattern = pattern;
    lamp.brightness = {.5, 1.5};
    files.cfg.vary = {lamp, lamp};
    Played played(files.cfg);
    played.start(4);
    const auto* diffuse = static_cast<const float*>(
        mjb_expanded(played.sim->worlds().batch(), "light_diffuse", nullptr, nullptr));
    found.push_back(diffuse[3 * mj_name2id(played.sim->model(), mjOBJ_LIGHT, "room/lamp")]);
    found.push_back(diffuse[3 * mj_name2id(played.sim->model(), mjOBJ_LIGHT, "room/around")]);
  }
  EXPECT_EQ(found[0], found[2]);
  EXPECT_NE(found[1], found[3]);  // it varies
}

TEST(EpisodeScene, AMoodSetsWhatAMaterialShows) {
  Files files;
  SceneVaryCfg glow;
  glow.what = VaryKind::kMaterial;
  glow.pattern = "room/top";
  glow.shows = "room/sky";
  files.cfg.moods = {{"bright", {}}, {"dark", {glow}}};
  files.cfg.vary = {};
  Played played(files.cfg);
  const mjModel* m = played.sim->model();
  std::set<std::string> seen;
  for (std::uint64_t episode = 0; episode < 20; ++episode) {
    played.start(episode);
    const auto* roles = static_cast<const int*>(
        mjb_expanded(played.sim->worlds().batch(), "mat_texid", nullptr, nullptr));
    const std::string mood = played.scene.mood(3, episode);
    seen.insert(mood);
    EXPECT_EQ(roles[mjNTEXROLE * mj_name2id(m, mjOBJ_MATERIAL, "room/top") + mjTEXROLE_EMISSIVE],
              mood == "dark" ? mj_name2id(m, mjOBJ_TEXTURE, "room/sky") : -1);
  }
  EXPECT_EQ(seen.size(), 2u);
  files.cfg.moods[1].vary[0].what = VaryKind::kGeom;
  EXPECT_THAT(error_of([&] { validate(files.cfg, ""); }),
              HasSubstr("shows applies to materials only"));
}

TEST(EpisodeScene, AnEpisodeHasOneMoodWhoseTintsMultiplyTheOtherColours) {
  Files files;
  const auto light_tint = [](std::array<double, 3> tint) {
    SceneVaryCfg lamp;
    lamp.what = VaryKind::kLight;
    lamp.pattern = "room/lamp";
    lamp.tint = tint;
    return lamp;
  };
  SceneVaryCfg glow;
  glow.what = VaryKind::kMaterial;
  glow.pattern = "room/top";
  glow.tint = {.5, .5, .5};
  files.cfg.moods = {{"bright", {light_tint({2, 2, 2})}}, {"dark", {light_tint({0, 0, 0}), glow}}};
  files.cfg.vary = {light_tint({1, .5, .25})};
  Played played(files.cfg, 2);
  mjBatch* batch = played.sim->worlds().batch();
  const mjModel* m = played.sim->model();
  const int light = mj_name2id(m, mjOBJ_LIGHT, "room/lamp");
  const int material = mj_name2id(m, mjOBJ_MATERIAL, "room/top");
  std::set<bool> seen;
  for (std::uint64_t episode = 0; episode < 20; ++episode) {
    played.start(episode, 0, 1);
    const auto row = [&](const char* field, int row_size, int at) {
      return static_cast<const float*>(mjb_expanded(batch, field, nullptr, nullptr)) + row_size +
             at;
    };
    const float* diffuse = row("light_diffuse", 3 * m->nlight, 3 * light);
    const float* specular = row("light_specular", 3 * m->nlight, 3 * light);
    const float* top = row("mat_rgba", 4 * m->nmat, 4 * material);
    const bool dark = diffuse[0] == 0;
    seen.insert(dark);
    EXPECT_EQ(played.scene.mood(3, episode), dark ? "dark" : "bright");
    for (int i = 0; i < 3; ++i) {
      const float factor = dark ? 0.0f : 2.0f * std::array{1.0f, .5f, .25f}[i];
      EXPECT_FLOAT_EQ(diffuse[i], factor * m->light_diffuse[3 * light + i]);
      EXPECT_FLOAT_EQ(specular[i], factor * m->light_specular[3 * light + i]);
      EXPECT_FLOAT_EQ(top[i], (dark ? .5f : 1.0f) * m->mat_rgba[4 * material + i]);
    }
  }
  EXPECT_EQ(seen.size(), 2u);
}

TEST(ShiftColour, RotatesHueAndScalesValue) {
  float red[3] = {1, 0, 0};
  shift_colour(120, 0, .5, red);
  EXPECT_NEAR(red[0], 0, 1e-6);
  EXPECT_NEAR(red[1], .5, 1e-6);
  EXPECT_NEAR(red[2], 0, 1e-6);
  float brown[3] = {.6f, .4f, .2f};
  shift_colour(0, 0, 1, brown);
  EXPECT_NEAR(brown[0], .6, 1e-6);
  EXPECT_NEAR(brown[1], .4, 1e-6);
  EXPECT_NEAR(brown[2], .2, 1e-6);
}

TEST(EpisodeScene, FaultsNameTheSetting) {
  const auto fault = [](const std::function<void(SceneFileCfg&)>& change) {
    Files files;
    change(files.cfg);
    return error_of([&] { Played played(files.cfg); });
  };
  EXPECT_THAT(fault([](auto& c) { c.regions[0].on = "room/tap"; }),
              HasSubstr("scene 'two_tables', region 'table': no geom named 'room/tap'; did you "
                        "mean 'room/top'?"));
  EXPECT_THAT(fault([](auto& c) { c.regions[0].on = "a/cube"; }),
              HasSubstr("body 'a/cube' has no level, fixed box"));
  EXPECT_THAT(fault([](auto& c) { c.objects = {{"room/table"}}; }), HasSubstr("has no free joint"));
  EXPECT_THAT(fault([](auto& c) { c.count = {3, 1}; }), HasSubstr("count is 3, 1"));
  EXPECT_THAT(fault([](auto& c) { c.regions[0].area = {1, 0, 0, 1}; }), HasSubstr("min x, max x"));
  EXPECT_THAT(
      fault([](auto& c) {
        c.regions[0].area = {.5, 1.6, 0, .2};
      }),
      HasSubstr("region 'table': area is [0.5, 1.6, 0, 0.2]: (1.6, 0) is not on the surface, "
                "which has x from 0.5 to 1.5 and y from"));
  EXPECT_THAT(
      fault([](auto& c) {
        c.regions[0].target_area = {3, 4, 3, 4};
      }),
      HasSubstr("region 'table': target_area is [3, 4, 3, 4]: (3, 3) is not on the surface"));
  EXPECT_THAT(fault([](auto& c) {
                SceneVaryCfg vary;
                vary.pattern = "rom/.*";
                c.vary = {vary};
              }),
              HasSubstr("vary light"));
  EXPECT_THAT(fault([](auto& c) { c.entities[1].name = "b"; }), HasSubstr("two entities"));
  EXPECT_THAT(fault([](auto& c) { c.entities[1].name = "room"; }), HasSubstr("two entities"));
}

TEST(EpisodeScene, VaryEntriesFollowThoseOfTheBase) {
  const Files files;
  files.write("base.toml", R"(
name = "base"
[[entities]]
name = "room"
model = "room.xml"
[[vary]]
what = "material"
pattern = "room/top"
brightness = [0.5, 0.6]
[[vary]]
what = "material"
pattern = "absent/.*"
)");
  const std::string head = "name = \"mine\"\nextends = \"base.toml\"\n";
  files.write("more.toml", head + "[[vary]]\nwhat = \"light\"\npattern = \"room/lamp\"\n");
  files.write("none.toml", head + "vary = []\n");
  files.write("wrong.toml", head + "[[vary]]\nwhat = \"light\"\npattern = \"room/sun\"\n");
  const auto patterns = [&](const char* file) {
    std::vector<std::string> found;
    for (const SceneVaryCfg& vary : load_scene(files.dir.file(file)).vary)
      found.push_back(vary.pattern);
    return found;
  };
  EXPECT_THAT(patterns("more.toml"), ::testing::ElementsAre("room/top", "absent/.*", "room/lamp"));
  EXPECT_THAT(patterns("none.toml"), ::testing::IsEmpty());

  const auto message = [&](const char* file) -> std::string {
    return error_of<KeyError>([&] { Played played(load_scene(files.dir.file(file))); });
  };
  EXPECT_EQ(message("more.toml"), "");  // the inherited 'absent/.*' matches nothing
  EXPECT_THAT(message("base.toml"), HasSubstr("absent"));
  EXPECT_THAT(message("wrong.toml"), HasSubstr("room/sun"));
}

// Absent objects neither move nor touch anything, though the floor extends to where they are.
TEST(EpisodeScene, AbsentObjectsAreInert) {
  Files files;
  files.cfg.count = {1, 1};
  Played played(files.cfg);
  EXPECT_EQ(played.scene.absentees().size(), 3u);
  played.sim->reset();
  played.start(1, 2);  // a start that is drawn again
  played.start(0, 1);
  const std::array before{played.at(0), played.at(1), played.at(2)};
  for (int k = 0; k < 200; ++k) played.sim->step();
  const double* qvel = robots::state_row(played.sim->worlds(), 0).qvel;
  const mjModel* m = played.sim->model();
  for (const int i : {0, 2}) {
    const int body = played.scene.objects()[i].body;
    EXPECT_FALSE(played.scene.body_present(0, body));
    EXPECT_EQ(norm(played.at(i) - before[i]), 0);
    for (int k = 0; k < 6; ++k) EXPECT_EQ(qvel[m->jnt_dofadr[m->body_jntadr[body]] + k], 0);
  }
  EXPECT_TRUE(played.scene.body_present(0, played.scene.objects()[1].body));
  EXPECT_NE(played.at(1).z, before[1].z) << "present objects move freely";
  EXPECT_LT(norm(played.at(1) - before[1]), 0.01);

  files.cfg.count = {-1, -1};
  EXPECT_TRUE(Played(files.cfg).scene.absentees().empty());
  files.cfg.count = {1, 1};  // nothing is laid out: all objects are where their models have them
  files.cfg.regions.clear();
  Played still(files.cfg);
  still.start(0, 1);
  EXPECT_TRUE(still.scene.present(0, 0));
  EXPECT_TRUE(still.scene.absentees().empty());
}

}  // namespace
}  // namespace mjsense::tasks::scenes
