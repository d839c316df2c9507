// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_references.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/scene.h"

namespace mjsense::tasks::scenes {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

// From above, with the robot at the origin, which looks along x:
//
//   x = 0.7           plate
//   x = 0.5   big block      small block       mug
//          y = 0.3          0             -0.2
struct Table {
  std::unique_ptr<EpisodeScene> scene;
  std::unique_ptr<scene::Scene> compiled;
  DataPtr data;

  explicit Table(const char* small_rgba = "0.8 0.1 0.1 1") {
    SceneFileCfg cfg;
    cfg.name = "blocks";
    const std::string xml =
        R"(<mujoco><worldbody>
             <body name="big" pos="0.5 0.3 0.03"><freejoint/>
               <geom type="box" size="0.03 0.03 0.03" rgba="0.1 0.3 0.8 1"/></body>
             <body name="small" pos="0.5 0 0.02"><freejoint/>
               <geom type="box" size="0.02 0.02 0.02" rgba=")" +
        std::string(small_rgba) + R"("/></body>
             <body name="plate" pos="0.7 0 0.01"><freejoint/>
               <geom type="cylinder" size="0.08 0.01" rgba="0.95 0.95 0.95 1"/></body>
             <body name="mug" pos="0.5 -0.2 0.04"><freejoint/>
               <geom type="cylinder" size="0.03 0.04" rgba="0.1 0.55 0.56 1"/></body>
           </worldbody></mujoco>)";
    cfg.models = [xml] {
      scene::SceneCfg models;
      models.base.xml = xml;
      return models;
    };
    const auto add = [&](const char* body, const char* text, std::vector<std::string> others = {}) {
      SceneObjectCfg object;
      object.body = body;
      object.text = text;
      object.other_texts = std::move(others);
      cfg.objects.push_back(object);
    };
    add("big", "block", {"cube"});
    add("small", "block", {"red brick"});
    add("plate", "plate");
    add("mug", "mug");
    scene = std::make_unique<EpisodeScene>(cfg);
    scene::SceneCfg whole = scene->scene_cfg("robot_0");
    std::erase_if(whole.entities, [](const auto& entity) { return entity.first == "robot_0"; });
    compiled = std::make_unique<scene::Scene>(std::move(whole));
    scene->initialize(compiled->model(), 1, "robot_0/");
    data.reset(mj_makeData(compiled->model()));
    mj_forward(compiled->model(), data.get());
  }
  References of(int object, const Pose& robot = {}, std::vector<int> others = {},
                bool far = false) const {
    const World world{.id = 0, .model = compiled->model(), .data = data.get()};
    return object_references(world, *scene, object, robot, others, far);
  }
};

TEST(ObjectReferences, NamesAndAttributesFitOneObject) {
  const Table table;
  const References small = table.of(1);
  EXPECT_THAT(small[0], ElementsAre("the red brick"));
  EXPECT_THAT(small[1], UnorderedElementsAre("the red block", "the smaller block"));
  EXPECT_THAT(table.of(0)[0], ElementsAre("the cube"));
  EXPECT_THAT(table.of(0)[1], UnorderedElementsAre("the blue block", "the larger block",
                                                   "the bigger block", "the blue cube"));
  EXPECT_THAT(table.of(3)[1], ElementsAre("the teal mug"));
}

// A colour between two words may be called either.
TEST(ObjectReferences, ColoursThatAreNotCertainAreNotMentioned) {
  const Table purplish("0.35 0.25 0.8 1");
  EXPECT_THAT(purplish.of(0)[1], Not(Contains("the blue block")));
  EXPECT_THAT(purplish.of(1)[0], IsEmpty()) << "it is not a red brick";
  const References small = purplish.of(1);
  for (const std::string& text : small[1]) EXPECT_THAT(text, ::testing::HasSubstr("small"));
}

TEST(ObjectReferences, DirectionsAreTheRobots) {
  const Table table;
  const References small = table.of(1);
  EXPECT_THAT(small[2], Contains("the red brick in front of the plate"));
  EXPECT_THAT(small[2], Contains("the red brick to the left of the mug"));
  EXPECT_THAT(small[2], Not(Contains("the block to the left of the mug"))) << "both blocks are";
  EXPECT_THAT(small[3], UnorderedElementsAre("the block on the right",
                                             "the block closer to the robot", "the nearer block"));
  EXPECT_THAT(table.of(0)[3],
              UnorderedElementsAre("the block on the left", "the block farther from the robot"));
  // From the other side of the table everything is mirrored.
  const Pose opposite{{1.4, 0, 0}, {0, 0, 0, 1}};
  EXPECT_THAT(table.of(1, opposite)[2], Contains("the red brick behind the plate"));
  EXPECT_THAT(table.of(1, opposite)[2], Contains("the red brick to the right of the mug"));
  EXPECT_THAT(table.of(1, opposite)[3], Contains("the block on the left"));
}

TEST(ObjectReferences, SomeObjectsAndDirectionsAreNotMentioned) {
  const Table table;
  const References without_plate = table.of(1, {}, {2});
  for (const std::string& text : without_plate[2])
    EXPECT_THAT(text, Not(::testing::HasSubstr("plate")));
  EXPECT_THAT(table.of(1, {}, {}, true)[2], IsEmpty());
  EXPECT_THAT(table.of(1, {}, {}, true)[3], IsEmpty());
}

TEST(ObjectReferences, NamesWithoutTheirFirstWordsMayBeUsed) {
  EXPECT_TRUE(may_be_called("soup can", "can"));
  EXPECT_TRUE(may_be_called("box of tea", "box"));
  EXPECT_FALSE(may_be_called("matchbox", "box"));
  EXPECT_FALSE(may_be_called("can", "soup can"));
}

TEST(ObjectReferences, KindsWithoutPhrasesAreNotDrawn) {
  Rng rng(1, 0, 0, 0);
  EXPECT_EQ(draw_reference({}, rng), "");
  const References one{{{}, {"the red mug"}, {}, {}}};
  for (int i = 0; i < 20; ++i) EXPECT_EQ(draw_reference(one, rng), "the red mug");
}

}  // namespace
}  // namespace mjsense::tasks::scenes
