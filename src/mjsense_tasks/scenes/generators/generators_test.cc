// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/scenes/episode_scene.h"
#include "mjsense_tasks/scenes/generators/generator.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/scenes/occupancy_grid.h"

namespace mjsense::tasks::scenes {
namespace {

using ::testing::HasSubstr;

// A house compiled without a robot, ready for episodes.
struct Built {
  EpisodeScene scene;
  std::unique_ptr<scene::Scene> whole;
  DataPtr data;

  explicit Built(const std::string& name) : scene(load_scene(name)) {
    scene::SceneCfg cfg = scene.scene_cfg("robot_0");
    std::erase_if(cfg.entities, [](const auto& e) { return e.second.model.empty(); });
    whole = std::make_unique<scene::Scene>(std::move(cfg));
    data = make_data(whole->model());
    scene.initialize(whole->model(), 1, "robot_0/");
  }
  std::string start(std::uint64_t seed) {
    Rng rng(seed, 0, 1, 0);
    mj_resetData(whole->model(), data.get());
    const int target =
        static_cast<int>(rng.below(static_cast<std::uint32_t>(scene.objects().size())));
    scene.sample(0, target, seed, 0, rng, robots::state_row(data.get()));
    mj_forward(whole->model(), data.get());
    return scene.fault({.id = 0, .model = whole->model(), .data = data.get()});
  }
};

// Without the scenes of packages, which are in folders of their own.
std::vector<std::string> generated_scenes() {
  std::vector<std::string> names;
  for (const std::string& name : scene_names()) {
    if (name.find('/') == std::string::npos && !load_scene(name).generator.empty())
      names.push_back(name);
  }
  return names;
}

TEST(Generators, HousesAreDeterministicAndDiffer) {
  for (const std::string& name : generated_scenes()) {
    std::vector<std::string> texts;
    for (const char* house : {"", ":0", ":7"}) {
      SceneFileCfg cfg = load_scene(name + house);
      const scene::ModelSource made = generate(cfg);
      texts.push_back(made.xml);
      for (const auto& [file, bytes] : made.assets) texts.back() += bytes;
    }
    EXPECT_EQ(texts[0], texts[1]) << name;
    EXPECT_NE(texts[0], texts[2]) << name;
  }
}

TEST(Generators, StartsWithoutPenetration) {
  for (const std::string& name : generated_scenes()) {
    for (int house = 0; house < 4; ++house) {
      Built built(name + ":" + std::to_string(house));
      if (built.scene.objects().empty()) continue;
      for (std::uint64_t seed = 0; seed < 20; ++seed)
        EXPECT_EQ(built.start(seed), "") << name << ":" << house << ", seed " << seed;
    }
  }
}

// Furniture is displaced in every episode. It must stay within the cells that the occupancy map
// marks.
TEST(Generators, OccupancyCoversDisplacedFurniture) {
  for (const std::string name : {"floor", "floor:3", "room_with_door", "room_with_door:5"}) {
    EpisodeScene scene(load_scene(name));
    scene::SceneCfg whole = scene.scene_cfg("robot_0");
    std::erase_if(whole.entities, [](const auto& e) { return e.second.model.empty(); });
    sim::Simulation sim(std::make_shared<scene::Scene>(whole), sim::SimulationCfg{.num_worlds = 1});
    const mjModel* m = sim.model();
    scene.initialize(m, 1, "robot_0/");
    scene.bind(sim);
    const auto stands = [&](int geom) { return m->body_treeid[m->geom_bodyid[geom]] < 0; };
    const DataPtr data = make_data(m);
    const ModelPtr own(mj_copyModel(nullptr, m));
    mj_kinematics(m, data.get());
    const auto map = [&](bool wherever) {
      OccupancyCfg cfg;
      if (wherever) cfg.elsewhere = [&](int geom) { return scene.elsewhere(geom); };
      return OccupancyGrid(m, data.get(), stands, cfg);
    };
    const OccupancyGrid known = map(true), still = map(false);
    std::map<int, std::set<double>> places;
    int outside = 0, others = 0;
    for (std::uint64_t episode = 0; episode < 12; ++episode) {
      scene.vary(0, 3, episode);
      sim.worlds().model_changed();
      sim.forward();
      mjb_getModel(sim.worlds().batch(), 0, own.get());
      mj_kinematics(own.get(), data.get());
      for (int g = 0; g < m->ngeom; ++g) {
        if (!scene.elsewhere(g).empty())
          places[m->geom_bodyid[g]].insert(data->geom_xpos[3 * g] + data->geom_xpos[3 * g + 1]);
      }
      const OccupancyGrid now = map(false);
      ASSERT_EQ(now.columns(), known.columns());
      for (int row = 0; row < now.rows(); ++row) {
        for (int column = 0; column < now.columns(); ++column) {
          outside += now.taken(column, row) && !known.taken(column, row) ? 1 : 0;
          others += now.taken(column, row) && !still.taken(column, row) ? 1 : 0;
        }
      }
    }
    EXPECT_EQ(outside, 0) << name;
    EXPECT_GT(others, 100) << name << ": furniture stands where the model does not have it";
    EXPECT_GE(places.size(), 5u) << name;
    for (const auto& [body, where] : places) EXPECT_GE(where.size(), 12u) << name;
  }
}

TEST(Generators, ErrorsNameValidGenerators) {
  EXPECT_THAT(error_of<ValueError>([] { load_scene("libero/table:3"); }),
              HasSubstr("has no generator"));
  EXPECT_THAT(error_of<KeyError>([] { load_scene("shelv:3"); }), HasSubstr("did you mean 'shelf'"));
  mjsense::testing::TempDir dir;
  const std::string file = dir.file("scene.toml");
  std::ofstream(file) << "name = \"mine\"\ngenerator = \"shelv\"\n";
  EXPECT_THAT(error_of<KeyError>([&] { EpisodeScene scene(load_scene(file)); }),
              HasSubstr("did you mean 'shelf'"));
  std::ofstream(file) << "name = \"mine\"\ngenerator = \"shelf\"\n[parameters]\nlowst = 1\n";
  EXPECT_THAT(error_of<KeyError>([&] { EpisodeScene scene(load_scene(file + ":2")); }),
              HasSubstr("did you mean 'lowest'"));
}

TEST(Generators, ParametersArePassedToTheGenerator) {
  mjsense::testing::TempDir dir;
  const std::string file = dir.file("scene.toml");
  std::ofstream(file) << "name = \"mine\"\nextends = \"shelf\"\n[parameters]\nlowest = 0.44\n";
  Built built(file);
  const int board = mj_name2id(built.whole->model(), mjOBJ_GEOM, "room/board_0");
  ASSERT_GE(board, 0);
  EXPECT_NEAR(built.whole->model()->geom_pos[3 * board + 2] +
                  built.whole->model()->geom_size[3 * board + 2],
              0.44, 1e-3);
}

}  // namespace
}  // namespace mjsense::tasks::scenes
