#include "mjsense/scene/scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "mjsense/core/error.h"

namespace mjsense {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kRobot = R"(<mujoco><option timestep="0.01"/><worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="base" pos="0 0 1"><freejoint/><geom size=".1"/><site name="imu"/>
    <body name="arm"><joint name="shoulder" ref="90"/><geom name="arm" size=".1"/></body></body></worldbody>
  <actuator><motor name="m" joint="shoulder"/></actuator>
  <sensor><gyro name="g" site="imu"/><accelerometer site="imu"/></sensor></mujoco>)";
constexpr const char* kTable = R"(<mujoco><worldbody><geom name="top" type="box" size="1 1 .1"/>
  <body name="drawer"><joint name="slide" type="slide"/><geom size=".1"/></body></worldbody>
  <keyframe><key qpos=".25"/></keyframe></mujoco>)";

EntityCfg xml(const char* text) { return {.model = {.xml = text}}; }

TEST(Scene, AttachesWithPrefixesInOrder) {
  SceneCfg cfg;
  cfg.terrain.emplace();
  cfg.entities = {{"robot", xml(kRobot)}, {"table", xml(kTable)}};
  Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  EXPECT_STREQ(mj_id2name(m, mjOBJ_BODY, 1), "terrain");
  EXPECT_THAT(scene.entity("robot").body_names, ElementsAre("base", "arm"));
  EXPECT_THAT(scene.entity("robot").geom_names, ElementsAre("floor", "geom_1", "arm"));
  EXPECT_THAT(scene.entity("robot").joint_names, ElementsAre("floating_base_joint", "shoulder"));
  EXPECT_THAT(scene.entity("table").body_names, ElementsAre("mocap_base", "drawer"));
  EXPECT_THAT(scene.entity("terrain").geom_names, ElementsAre("terrain"));
  EXPECT_EQ(m->nmocap, 1);
  ASSERT_EQ(m->nkey, 1);
  EXPECT_THAT(std::vector<double>(m->key_qpos, m->key_qpos + m->nq),
              ElementsAre(0, 0, 0, 1, 0, 0, 0, 0, .25));
  EXPECT_DOUBLE_EQ(m->qpos0[2], 1.0);
  EXPECT_DOUBLE_EQ(m->qpos0[7], M_PI / 2);
  EXPECT_DOUBLE_EQ(m->opt.timestep, 0.002);
  EXPECT_THAT(scene.warnings(), ElementsAre(HasSubstr("timestep")));
  ASSERT_EQ(scene.sensors().size(), 2u);
  EXPECT_EQ(scene.sensors()[0]->name(), "robot/g");
  EXPECT_EQ(scene.sensors()[1]->name(), "robot/sensor_1");
  EXPECT_THAT(scene.to_xml(), HasSubstr("init_state"));
}

}  // namespace
}  // namespace mjsense
