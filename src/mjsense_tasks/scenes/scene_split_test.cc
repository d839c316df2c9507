// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/scene_split.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/scenes/object_catalogue.h"

namespace mjsense::tasks::scenes {
namespace {

using ::testing::HasSubstr;

// Kinds of a scene's objects without its receptacles.
std::set<std::string> kinds(const std::string& scene) {
  std::set<std::string> names, found;
  for (const SceneEntityCfg& entity : load_scene(scene).entities) names.insert(entity.name);
  for (const CatalogueObjectCfg& object : object_catalogue().objects) {
    if (names.contains(object.name) && !object.receptacle) found.insert(object.kind);
  }
  return found;
}

double brightest(const std::string& scene, int end) {
  for (const SceneVaryCfg& vary : load_scene(scene).vary) {
    if (vary.what == VaryKind::kLight) return vary.brightness[end];
  }
  return 0;
}

TEST(SceneSplit, NoKindIsInBothAndAllAreInOne) {
  for (const std::string name : {"varied_table", "tableware", "clutter", "table"}) {
    const std::set<std::string> train = kinds(name + "@train"), test = kinds(name + "@test");
    std::set<std::string> both = train;
    both.insert(test.begin(), test.end());
    EXPECT_FALSE(test.empty()) << name;
    EXPECT_EQ(train.size() + test.size(), both.size()) << name;
    EXPECT_EQ(both, kinds(name)) << name;
  }
}

TEST(SceneSplit, CatalogueObjectsOfAHouseAreChosenWithinTheSplit) {
  for (int house = 0; house < 5; ++house) {
    const std::set<std::string> train = kinds("assorted@train:" + std::to_string(house));
    EXPECT_EQ(train.size(), 12u);
    for (const std::string& kind : train) EXPECT_TRUE(has_kind(SceneSplit::kTrain, kind)) << kind;
    for (const std::string& kind : kinds("assorted@test:" + std::to_string(house)))
      EXPECT_TRUE(has_kind(SceneSplit::kTest, kind)) << kind;
  }
}

TEST(SceneSplit, HousesAndLightsAreInOneOfThem) {
  std::multiset<int> houses;
  for (int n = 0; n < 8; ++n) houses.insert(load_scene("kitchen@train:" + std::to_string(n)).house);
  for (int n = 0; n < 2; ++n) houses.insert(load_scene("kitchen@test:" + std::to_string(n)).house);
  EXPECT_EQ(houses, (std::multiset<int>{0, 1, 2, 3, 4, 5, 6, 7, 8, 9}));
  EXPECT_LE(brightest("varied_table@train", 1), brightest("varied_table@test", 0));
  EXPECT_EQ(brightest("varied_table@test", 1), brightest("varied_table", 1));
}

TEST(SceneSplit, UnknownAndEmptySplitsAreErrors) {
  EXPECT_THAT(error_of<KeyError>([] { load_scene("varied_table@trian"); }),
              HasSubstr("did you mean 'train'"));
  SceneFileCfg pear = load_scene("table");
  std::erase_if(pear.entities, [](const SceneEntityCfg& e) { return e.name != "pear"; });
  std::erase_if(pear.objects, [](const SceneObjectCfg& o) { return o.body != "pear/pear"; });
  EXPECT_EQ(split_scene(pear, SceneSplit::kTest).entities.size(), 1u);
  EXPECT_THAT(error_of<ValueError>([&] { split_scene(pear, SceneSplit::kTrain); }),
              HasSubstr("has no objects in its split 'train'"));
}

TEST(SceneSplit, NamesOfSplits) {
  EXPECT_EQ(name_of_split("varied_table", "train"), "varied_table@train");
  EXPECT_EQ(name_of_split("kitchen:12", "test"), "kitchen@test:12");
  EXPECT_EQ(name_of_split("a@b/scene.toml", "test"), "a@b/scene.toml@test");
  EXPECT_THAT(error_of<ValueError>([] { name_of_split("kitchen@train:3", "test"); }),
              HasSubstr("scene 'kitchen@train:3' already names a split, but split is 'test'"));
  std::string_view path = "a@b/scene.toml";
  EXPECT_FALSE(cut_split(path));
  EXPECT_EQ(path, "a@b/scene.toml");
}

}  // namespace
}  // namespace mjsense::tasks::scenes
