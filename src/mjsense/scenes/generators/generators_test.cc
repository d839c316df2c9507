// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/scenes/episode_scene.h"
#include "mjsense/scenes/generators/generator.h"
#include "mjsense/scenes/load_scene.h"

namespace mjsense {
namespace {

using ::testing::HasSubstr;

template <class Error = ValueError, class F>
std::string error_of(F f) {
  try {
    f();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

// One house: compiled without a robot, ready for episodes.
struct Built {
  EpisodeScene scene;
  std::unique_ptr<Scene> whole;
  std::shared_ptr<mjData> data;

  explicit Built(const std::string& name) : scene(load_scene(name)) {
    SceneCfg cfg = scene.scene_cfg("robot_0");
    std::erase_if(cfg.entities, [](const auto& e) { return e.second.model.empty(); });
    whole = std::make_unique<Scene>(std::move(cfg));
    data = {mj_makeData(whole->model()), mj_deleteData};
    scene.initialize(whole->model(), 1, "robot_0/");
  }
  std::string start(std::uint64_t seed) {
    Rng rng(seed, 0, 1, 0);
    mj_resetData(whole->model(), data.get());
    const int target =
        static_cast<int>(rng.below(static_cast<std::uint32_t>(scene.objects().size())));
    scene.sample(0, target, seed, 0, rng, state_row(data.get()));
    mj_forward(whole->model(), data.get());
    return scene.fault({.id = 0, .model = whole->model(), .data = data.get()});
  }
};

std::vector<std::string> generated_scenes() {
  std::vector<std::string> names;
  for (const std::string& name : scene_names()) {
    if (!load_scene(name).generator.empty()) names.push_back(name);
  }
  return names;
}

TEST(Generators, AHouseIsTheSameEveryTimeAndNeighboursDiffer) {
  for (const std::string& name : generated_scenes()) {
    std::vector<std::string> texts;
    for (const char* house : {"", ":0", ":7"}) {
      SceneFileCfg cfg = load_scene(name + house);
      const ModelSource made = generate(cfg);
      texts.push_back(made.xml);
      for (const auto& [file, bytes] : made.assets) texts.back() += bytes;
    }
    EXPECT_EQ(texts[0], texts[1]) << name;
    EXPECT_NE(texts[0], texts[2]) << name;
  }
}

TEST(Generators, NothingStartsInsideAnything) {
  for (const std::string& name : generated_scenes()) {
    for (int house = 0; house < 4; ++house) {
      Built built(name + ":" + std::to_string(house));
      if (built.scene.objects().empty()) continue;
      for (std::uint64_t seed = 0; seed < 20; ++seed)
        EXPECT_EQ(built.start(seed), "") << name << ":" << house << ", seed " << seed;
    }
  }
}

TEST(Generators, ErrorsNameWhatThereIs) {
  EXPECT_THAT(error_of([] { load_scene("table:3"); }), HasSubstr("has no generator"));
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

TEST(Generators, ParametersReachTheHouse) {
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
}  // namespace mjsense
