// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/given_start.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/test_model.h"

namespace mjsense::tasks::episode {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

// Two free bodies, a drawer and a fixed shelf.
constexpr const char* kScene = R"(
<mujoco>
  <worldbody>
    <body name="mug/mug"><freejoint/><geom size=".03"/></body>
    <body name="left/cup" pos="1 0 0"><freejoint/><geom size=".03"/></body>
    <body name="right/cup" pos="2 0 0"><freejoint/><geom size=".03"/></body>
    <body name="shelf" pos="0 3 0">
      <geom size=".1"/>
      <body name="drawer"><joint name="pull" type="slide" axis="1 0 0"/><geom size=".1"/></body>
    </body>
  </worldbody>
</mujoco>)";

TEST(GivenStart, WritesPosesAndJointsAtRest) {
  const ModelPtr model = compile_mjcf(kScene);
  const DataPtr data = make_data(model.get());
  std::fill_n(data->qvel, model->nv, 1.0);
  const GivenStarts starts = read_starts(R"({"7": {
    "bodies": {"mug": [0.1, 0.2, 0.3, 0, 1, 0, 0], "shelf": [0, 3, 0, 1, 0, 0, 0]},
    "joints": {"pull": 0.25}, "objects": {"pickup_obj": "mug"}, "thresholds": {"lift": 0.5}}})");
  const GivenStart& start = starts.at(7);
  check_names(model.get(), starts, "test");
  write_start(model.get(), start, robots::state_row(data.get()));
  EXPECT_THAT(std::vector<double>(data->qpos, data->qpos + 7),
              ::testing::ElementsAre(0.1, 0.2, 0.3, 0, 1, 0, 0));
  EXPECT_EQ(data->qpos[model->nq - 1], 0.25);
  EXPECT_THAT(std::vector<double>(data->qvel, data->qvel + 6), ::testing::Each(0.0));
  EXPECT_EQ(data->qvel[6], 1) << "other bodies are not changed";
  EXPECT_EQ(start.thresholds.at("lift"), 0.5);
}

TEST(GivenStart, NamesThatAreNotThereAreOneError) {
  const ModelPtr model = compile_mjcf(kScene);
  EXPECT_EQ(find_name(model.get(), mjOBJ_BODY, "cup"), -1) << "two bodies end with it";
  const GivenStarts starts = read_starts(R"({"0": {"bodies": {"cup": [0, 0, 0, 1, 0, 0, 0]}},
    "1": {"joints": {"push": 1}, "absent": ["plate", "drawer"],
          "bodies": {"shelf": [0, 3, 0.1, 1, 0, 0, 0]}}})");
  EXPECT_THAT(
      error_of<ValueError>([&] { check_names(model.get(), starts, "task 'pick'"); }),
      AllOf(HasSubstr("task 'pick': given starts: the scene has no 'cup', 'push'; its free "
                      "bodies are 'mug/mug', 'left/cup', 'right/cup'"),
            HasSubstr("'drawer', 'shelf' cannot be moved"), ::testing::Not(HasSubstr("plate"))));
}

TEST(GivenStart, InvalidTextsThrow) {
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"[]", "must be a JSON object"},
           {"{", "must be a JSON object"},
           {R"({"x": {}})", "'x' is not the number of an episode"},
           {R"({"1": 2})", "1 must be an object"},
           {R"({"1": {"bodies": {"a": [1, 2]}}})", "'a' of episode 1 must be 7 finite numbers"},
           {R"({"1": {"bodies": {"a": [0, 0, 0, 0, 0, 0, 0]}}})", "whose quaternion is not 0"},
           {R"({"1": {"robot": {"arm": "x"}}})", "must be a list of finite numbers"},
           {R"({"1": {"scene": 1}})", "the unknown member 'scene'"}}) {
    EXPECT_THAT(error_of<ValueError>([&, &given = text] { read_starts(given); }),
                HasSubstr(message))
        << text;
  }
}

}  // namespace
}  // namespace mjsense::tasks::episode
