// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/suite.h"

#include <gmock/gmock.h>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/observe/shared_field.h"
#include "mjsense/observe/testing/world.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::observe {
namespace {

class Picture : public Sensor {
 public:
  explicit Picture(std::string name) : Sensor(std::move(name)) {}
  std::string_view kind() const override { return "picture"; }
  Stage stage() const override { return Stage::kCast; }
  void initialize(const SensorInit& init) override {
    clear_fields();
    SensorSpec spec;
    spec.shape = {2, 3, 1};
    add_field("depth", spec, init.num_worlds);
  }
  void compute(const World&) override {}
};

TEST(Suite, KeepsOrderAndNamesBothOwnersOfADuplicate) {
  SensorSuite suite;
  suite.add(std::make_shared<Picture>("qpos"), "task 'pick'");
  suite.add(std::make_shared<Picture>("exo"), "task 'pick'");
  suite.add(std::make_shared<Picture>("arm"), "robot 'franka'");
  EXPECT_THAT(suite.names(), ::testing::ElementsAre("qpos", "exo", "arm"));
  EXPECT_EQ(suite.owner("arm"), "robot 'franka'");
  EXPECT_EQ(error_of([&] { suite.add(std::make_shared<Picture>("qpos"), "robot 'franka'"); }),
            "'qpos' is a duplicated sensor uuid: from task 'pick' and from robot 'franka'");
  EXPECT_EQ(suite.size(), 3u);
  EXPECT_EQ(error_of([&] { suite.get("qpo"); }),
            "suite: no sensor named 'qpo'; did you mean 'qpos'?");
  EXPECT_EQ(suite.find("qpo"), nullptr);
  EXPECT_THAT(error_of([&] { suite.refresh(); }), ::testing::HasSubstr("bind()"));
}

TEST(Suite, SelectKeepsTheGivenSensorsInOrder) {
  SensorSuite suite;
  for (const char* name : {"a", "b", "c"}) suite.add(std::make_shared<Picture>(name), name);
  const std::vector<std::string> wanted{"c", "a"}, twice{"c", "c"}, unknown{"d"};
  suite.select(wanted);
  EXPECT_THAT(suite.names(), ::testing::ElementsAre("c", "a"));
  EXPECT_EQ(suite.owner("c"), "c");
  EXPECT_EQ(error_of([&] { suite.select(twice); }), "suite: sensor 'c' is given twice");
  EXPECT_THAT(error_of([&] { suite.select(unknown); }),
              ::testing::HasSubstr("no sensor named 'd'"));
  EXPECT_EQ(suite.size(), 2u) << "as it was";
}

TEST(Suite, BelongsToOneSimulation) {
  scene::SceneCfg cfg;
  cfg.base.xml = "<mujoco><worldbody><body><geom size='.1'/></body></worldbody></mujoco>";
  sim::Simulation one(std::make_shared<scene::Scene>(cfg), {}),
      other(std::make_shared<scene::Scene>(cfg), {});
  SensorSuite suite;
  suite.bind(one);
  EXPECT_EQ(error_of([&] { suite.bind(one); }), "");
  EXPECT_THAT(error_of([&] { suite.bind(other); }), ::testing::HasSubstr("one simulation"));
}

TEST(Suite, ExtendKeepsSensorsBeforeADuplicate) {
  SensorSuite suite;
  const std::shared_ptr<Sensor> more[] = {std::make_shared<Picture>("a"),
                                          std::make_shared<Picture>("a"),
                                          std::make_shared<Picture>("b")};
  EXPECT_NE(error_of([&] { suite.extend(more); }), "");
  EXPECT_THAT(suite.names(), ::testing::ElementsAre("a"));
}

TEST(SharedField, SharesMemoryUnderAnotherNameAndShape) {
  TestWorld w("<mujoco/>");
  Picture camera("wrist");
  camera.initialize(w.init(2));
  SharedField depth("wrist_depth", camera, "depth", [](SensorSpec& spec) {
    spec.shape = {2, 3};
    spec.storage = Storage::kDepthVideo;
  });
  depth.initialize(w.init(2));
  EXPECT_EQ(depth.stage(), Stage::kPostCast);
  EXPECT_EQ(depth.fields()[0].spec.name, "wrist_depth");
  EXPECT_EQ(depth.fields()[0].data.shape(), Shape({2, 2, 3}));
  camera.fields()[0].data.row<float>(1)[4] = 7;
  EXPECT_EQ(depth.fields()[0].data.row<float>(1)[4], 7);
  SharedField all("copy", camera);
  all.initialize(w.init(2));
  ASSERT_EQ(all.fields().size(), camera.fields().size());
  EXPECT_EQ(all.fields()[0].name, "depth");
  EXPECT_EQ(all.fields()[0].data.row<float>(1)[4], 7);

  SharedField wrong("wrist_depth", camera, "dept");
  EXPECT_EQ(
      error_of([&] { wrong.initialize(w.init(2)); }),
      "sensor 'wrist_depth', which shows 'wrist': no field named 'dept'; did you mean 'depth'?");
  SharedField small("wrist_depth", camera, "depth", [](SensorSpec& spec) { spec.shape = {2}; });
  EXPECT_THAT(error_of([&] { small.initialize(w.init(2)); }), ::testing::HasSubstr("cannot share"));
}

}  // namespace
}  // namespace mjsense::observe
