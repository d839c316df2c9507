// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/terrain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/scene/scene.h"

namespace mjsense::scene {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Terrain, PlaneOriginsAreAGrid) {
  Terrain plane({});
  EXPECT_THAT(plane.env_origins(1, 3), ElementsAre(0, 0, 0));
  EXPECT_THAT(plane.env_origins(2, 3), ElementsAre(1.5, 0, 0, -1.5, 0, 0));
  EXPECT_THAT(plane.env_origins(5, 2),
              ElementsAre(2, -1, 0, 2, 1, 0, 0, -1, 0, 0, 1, 0, -2, -1, 0));
  EXPECT_THAT(plane.env_origins(9, 3), ElementsAre(3, -3, 0, 3, 0, 0, 3, 3, 0, 0, -3, 0, 0, 0, 0, 0,
                                                   3, 0, -3, -3, 0, -3, 0, 0, -3, 3, 0));
}

class Generated {
 public:
  explicit Generated(TerrainCfg cfg) {
    cfg.terrain_type = "generator";
    SceneCfg scene;
    scene.terrain = std::move(cfg);
    scene_ = std::make_unique<Scene>(std::move(scene));
    data_.reset(mj_makeData(scene_->model()));
    mj_forward(scene_->model(), data_.get());
  }
  const Terrain& terrain() const { return *scene_->terrain(); }
  const Scene& scene() const { return *scene_; }
  // Height of the ground at (x, y); NaN if there is none.
  double height(double x, double y) const {
    const mjtNum from[] = {x, y, 50}, down[] = {0, 0, -1};
    int geom = -1;
    const double t =
        mj_ray(scene_->model(), data_.get(), from, down, nullptr, 1, -1, &geom, nullptr);
    return t < 0 ? std::nan("") : 50 - t;
  }

 private:
  std::unique_ptr<Scene> scene_;
  DataPtr data_;
};

TEST(Terrain, SpawnPointsAreOnTheGround) {
  Generated g({.levels = 3});
  ASSERT_EQ(g.terrain().levels(), 3);
  ASSERT_EQ(g.terrain().types(), 6);
  const auto& origins = g.terrain().tile_origins();
  ASSERT_EQ(origins.size(), 3u * 6 * 3);
  for (std::size_t i = 0; i < origins.size(); i += 3) {
    EXPECT_NEAR(g.height(origins[i] + 1e-4, origins[i + 1] + 1e-4), origins[i + 2], 1e-3) << i / 3;
  }
  EXPECT_THAT(g.scene().entity("terrain").body_names, ElementsAre("terrain"));
  EXPECT_DOUBLE_EQ(origins[0], -8);
  EXPECT_DOUBLE_EQ(origins[1], -20);
}

// Hand-computed heights at asymmetric points, which a transposed or mirrored height field would
// fail.
TEST(Terrain, HeightsEqualHandComputedValues) {
  TerrainCfg cfg;
  cfg.levels = 1;
  cfg.tile_size = {8, 6};
  cfg.sub_terrains = {
      {"slope", {.kind = "slope", .slope = {.2, .4}}},
      {"pit", {.kind = "slope", .inverted = true, .slope = {.3, .3}}},
      {"stairs", {.kind = "stairs", .step_height = {.1, .1}, .step_width = .5}},
      {"hole", {.kind = "stairs", .inverted = true, .step_height = {.1, .1}, .step_width = .5}},
      {"waves", {.kind = "waves", .amplitude = {.1, .1}, .waves = 1}}};
  Generated g(cfg);
  const auto at = [&](int type, double x, double y) {
    const double* o = g.terrain().tile_origins().data() + 3 * type;
    return g.height(o[0] + x, o[1] + y);
  };
  EXPECT_NEAR(at(0, 0, 0), .3 * 2, 1e-6);
  EXPECT_NEAR(at(0, 3.5, .3), .3 * .5, 1e-6);
  EXPECT_NEAR(at(0, -.35, 2.5), .3 * .5, 1e-6);
  EXPECT_NEAR(at(1, 3.5, .3), -.3 * .5, 1e-6);
  EXPECT_NEAR(at(2, 3.25, 0), .1, 1e-9);
  EXPECT_NEAR(at(2, 0, -2.75), 0, 1e-9);
  EXPECT_NEAR(at(2, .2, .3), .4, 1e-9);
  EXPECT_NEAR(at(3, 3.25, 0), -.1, 1e-9);
  EXPECT_NEAR(at(3, 0, -1.9), -.2, 1e-9);
  EXPECT_NEAR(at(3, .2, .3), -.4, 1e-9);
  EXPECT_NEAR(at(4, -2, -1.5), .1, 1e-4);
  EXPECT_NEAR(at(4, 2, -1.5), -.1, 1e-4);
  EXPECT_NEAR(at(4, -1, -.75), .1 * .5, 2e-3);
  EXPECT_NEAR(g.height(4 + 2, 0), 0, 1e-9);  // the border
}

TEST(Terrain, SteppingStonesHaveGaps) {
  TerrainCfg cfg;
  cfg.levels = 2;
  cfg.border = 0;
  cfg.sub_terrains = {{"stones",
                       {.kind = "stepping_stones",
                        .stone_width = {.5, .3},
                        .gap = {.1, .3},
                        .stone_height = {0, .1}}}};
  Generated g(cfg);
  int low = 0, high = 0;
  for (double x = -3.9; x < 3.9; x += .09) {
    const double z = g.height(-4 + x, 3.1);
    EXPECT_TRUE(std::abs(z) < 1e-9 || std::abs(z + 1) < 1e-9) << x << " " << z;
    z < -.5 ? ++low : ++high;
  }
  EXPECT_NEAR(low / double(low + high), 1.0 / 6, .06);  // fraction of gaps
  EXPECT_NEAR(g.height(-4, 0), 0, 1e-9);
  // No gap is wider than configured, also next to the platform.
  for (double widest = 0, x = -3.8; x < 3.8; x += .01) {
    widest = g.height(-4 + x, .21) < -.5 ? widest + .01 : 0;
    EXPECT_LT(widest, .12) << x;
  }
  EXPECT_TRUE(std::isnan(g.height(20, 20)));
}

TEST(Terrain, IsDeterministicAndDistributesColumns) {
  TerrainCfg cfg;
  cfg.terrain_type = "generator";
  cfg.seed = 5;
  cfg.types = 8;
  cfg.max_init_level = 2;
  cfg.sub_terrains = {{"a", {.kind = "rough", .proportion = 3}},
                      {"b", {.kind = "flat", .proportion = 1}}};
  Generated one(cfg), two(cfg);
  cfg.seed = 6;
  Generated other(cfg);
  EXPECT_EQ(one.height(-7.3, -13.1), two.height(-7.3, -13.1));
  EXPECT_NE(one.height(-7.3, -13.1), other.height(-7.3, -13.1));
  int b = 0;
  for (int j = 0; j < 8; ++j) b += one.terrain().type_name(j) == "b";
  EXPECT_EQ(b, 2);
  const std::vector<int> tiles = one.terrain().env_tiles(160);
  std::vector<int> levels(5), types(8);
  for (int i = 0; i < 160; ++i) ++levels[tiles[2 * i]], ++types[tiles[2 * i + 1]];
  EXPECT_THAT(types, ::testing::Each(20));
  EXPECT_EQ(levels[3] + levels[4], 0);
  EXPECT_GT(std::min({levels[0], levels[1], levels[2]}), 30);
  EXPECT_EQ(one.scene().env_origins(160), two.scene().env_origins(160));
}

// Difficult tiles are redder, boxes and height fields alike.
TEST(Terrain, TheColourIsThatOfTheDifficulty) {
  for (const SubTerrainCfg& kind : {SubTerrainCfg{.kind = "stairs"}, {.kind = "rough"}}) {
    TerrainCfg cfg;
    cfg.terrain_type = "generator";
    cfg.levels = 4;
    cfg.types = 1;
    cfg.sub_terrains = {{"a", kind}};
    const Generated generated(cfg);
    const mjModel* m = generated.scene().model();
    int first = -1, last = -1;  // along x
    for (int g = 0; g < m->ngeom; ++g) {
      if (m->geom_rgba[4 * g] == m->geom_rgba[4 * g + 1]) continue;  // the border is grey
      if (first < 0 || m->geom_pos[3 * g] < m->geom_pos[3 * first]) first = g;
      if (last < 0 || m->geom_pos[3 * g] > m->geom_pos[3 * last]) last = g;
    }
    const auto redness = [&](int g) { return m->geom_rgba[4 * g] - m->geom_rgba[4 * g + 1]; };
    ASSERT_GE(first, 0);
    EXPECT_GT(redness(last), redness(first) + 0.2);
  }
}

TEST(Terrain, ErrorsNameTheSetting) {
  const auto fault = [](TerrainCfg cfg) -> std::string {
    return error_of<ValueError>([&] {
      SceneCfg scene;
      scene.terrain = std::move(cfg);
      Scene{std::move(scene)};
    });
  };
  EXPECT_THAT(fault({.terrain_type = "generator", .levels = 0}),
              HasSubstr("terrain: levels is 0: must be at least 1"));
  EXPECT_THAT(fault({.terrain_type = "generator", .sub_terrains = {{"x", {.gap = {0, -1}}}}}),
              HasSubstr("terrain: sub_terrains['x']: gap[1] is -1: must be at least 0"));
  EXPECT_THAT(fault({.terrain_type = "generator", .sub_terrains = {{"x", {.platform_width = 9}}}}),
              HasSubstr("sub_terrains['x']: platform_width is 9"));
  EXPECT_THAT(fault({.terrain_type = "generator", .max_init_level = 5}),
              HasSubstr("max_init_level is 5"));
}

// Colours need a light, a sky and a textured ground. Existing ones are kept.
TEST(Terrain, DaylightAddsMissingElements) {
  const auto count = [](const mjModel* m, mjtTexture type) {
    return std::count(m->tex_type, m->tex_type + m->ntex, type);
  };
  SceneCfg cfg;
  cfg.terrain = TerrainCfg{};
  {
    const Scene scene(cfg);
    const mjModel* m = scene.model();
    EXPECT_EQ(m->nlight, 1);
    EXPECT_EQ(count(m, mjTEXTURE_SKYBOX), 1);
    const int ground = mj_name2id(m, mjOBJ_GEOM, "terrain");
    ASSERT_GE(m->geom_matid[ground], 0);
    EXPECT_GE(m->mat_texid[m->geom_matid[ground] * mjNTEXROLE + mjTEXROLE_RGB], 0);
    EXPECT_EQ(m->mat_rgba[4 * m->geom_matid[ground]], 0.5f);
  }
  cfg.spec_fn = [](mjSpec* spec) {
    mjs_addLight(mjs_findBody(spec, "world"), nullptr);
    mjsTexture* sky = mjs_addTexture(spec, nullptr);
    sky->type = mjTEXTURE_SKYBOX;
    sky->builtin = mjBUILTIN_FLAT;
    sky->width = 8;
    sky->height = 48;
    mjs_asGeom(mjs_findElement(spec, mjOBJ_GEOM, "terrain"))->rgba[0] = 0.4f;
  };
  {
    const Scene scene(cfg);
    EXPECT_EQ(scene.model()->nlight, 1);
    EXPECT_EQ(scene.model()->ntex, 1);
    EXPECT_EQ(scene.model()->nmat, 0);
  }
  cfg.spec_fn = {};
  // Lights that a robot carries or that follow it do not replace the sun; a lamp of the room does.
  const auto lights = [&](const std::string& lamp, const std::string& torch) {
    SceneCfg with = cfg;
    with.entities.emplace_back(
        "robot",
        EntityCfg{.model = {.xml = "<mujoco><worldbody>" + lamp + "<body name='b'>" + torch +
                                   "<freejoint/><geom size='.1'/></body></worldbody></mujoco>"}});
    return Scene(with).model()->nlight;
  };
  EXPECT_EQ(lights("<light mode='trackcom' pos='0 0 2'/>", ""), 2);
  EXPECT_EQ(lights("<light mode='targetbody' target='b' pos='0 0 2'/>", ""), 2);
  EXPECT_EQ(lights("", "<light pos='0 0 2'/>"), 2);
  EXPECT_EQ(lights("", "<light type='directional'/>"), 1);
  EXPECT_EQ(lights("<light pos='0 0 2'/>", ""), 1);
  cfg.terrain->daylight = false;
  const Scene scene(cfg);
  EXPECT_EQ(scene.model()->nlight + scene.model()->ntex + scene.model()->nmat, 0);
}

}  // namespace
}  // namespace mjsense::scene
