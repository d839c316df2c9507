// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/terrain_height/terrain_height_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/testing/lab.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::ElementsAre;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using ::testing::Pointwise;

//        foot            A floor at z = 0, a step 0.5 m high for 0.5 < x < 2.5; 20 m away, at
//   ______|_____         x = 20, a pit whose ground is at -3 m.
//   floor |step |_
constexpr char kField[] = R"(
<mujoco><worldbody>
  <geom name="floor" type="box" size="4 4 .5" pos="0 0 -.5"/>
  <geom name="step" type="box" size="1 2 .225" pos="1.5 0 .275"/>
  <geom name="pit" type="box" size="1 1 .5" pos="20 0 -3.5"/>
  <body name="foot" pos="0 0 2">
    <freejoint/>
    <geom size=".01" mass="1" group="3"/>
    <site name="toe" pos="0 0 -.1"/>
  </body>
</worldbody></mujoco>)";

std::shared_ptr<TerrainHeightSensorCfg> height(HeightReduction reduction = HeightReduction::kMin) {
  auto cfg = std::make_shared<TerrainHeightSensorCfg>();
  cfg->name = "height";
  cfg->frame = {{"body", "foot", "r"}};
  cfg->pattern = GridPattern{.size = {0, 0}};
  cfg->ray_alignment = "world";
  cfg->max_distance = 1.0;
  cfg->reduction = reduction;
  return cfg;
}

struct HeightLab : testing::Lab {
  explicit HeightLab(std::shared_ptr<const SensorCfg> cfg) : Lab("r", kField, {std::move(cfg)}) {}

  // Heights when the foot is at (x, 0, z), on its side.
  std::vector<float> at(double x, double z) {
    pose({x, 0, z, testing::kOnItsSide, testing::kOnItsSide, 0, 0});
    return read("heights", "height", 0);
  }
};

TEST(TerrainHeight, IsFromTheFrameToTheGroundBelow) {
  HeightLab lab(height());
  EXPECT_THAT(lab.at(-2, 0.25), ElementsAre(FloatNear(0.25f, 1e-6f)));
  EXPECT_THAT(lab.at(1.5, 0.7), ElementsAre(FloatNear(0.2f, 1e-6f)));
}

// Three rays, 0.1 m apart along x, the middle one 1 cm before the step: 0.7, 0.7 and 0.2 m.
TEST(TerrainHeight, ReducesTheRaysOfAFrame) {
  const auto over_the_edge = [](HeightReduction reduction) {
    auto cfg = height(reduction);
    cfg->pattern = GridPattern{.size = {0.2, 0}, .resolution = 0.1};
    return HeightLab(cfg).at(0.49, 0.7);
  };
  EXPECT_THAT(over_the_edge(HeightReduction::kMin), ElementsAre(FloatNear(0.2f, 1e-6f)));
  EXPECT_THAT(over_the_edge(HeightReduction::kMax), ElementsAre(FloatNear(0.7f, 1e-6f)));
  EXPECT_THAT(over_the_edge(HeightReduction::kMean), ElementsAre(FloatNear(1.6f / 3, 1e-6f)));
  EXPECT_THAT(over_the_edge(HeightReduction::kNone),
              Pointwise(FloatNear(1e-6f), {0.7f, 0.7f, 0.2f}));
}

TEST(TerrainHeight, RaysThatMissGiveTheLimit) {
  auto cfg = height(HeightReduction::kNone);
  cfg->pattern = GridPattern{.size = {0.2, 0}, .resolution = 0.1};
  // Two rays would hit the floor, which is more than max_distance below; the third hits the step.
  EXPECT_THAT(HeightLab(cfg).at(0.49, 1.2), Pointwise(FloatNear(1e-6f), {1.0f, 1.0f, 0.7f}));
}

TEST(TerrainHeight, IfAllRaysMissTheGroundBelowIsUsed) {
  HeightLab lab(height());
  EXPECT_THAT(lab.at(-2, 50), ElementsAre(1.0f)) << "far above";
  EXPECT_THAT(lab.at(-2, -0.3), ElementsAre(0.0f)) << "inside the floor";
  EXPECT_THAT(lab.at(1.5, 0.4), ElementsAre(0.0f)) << "inside the step";
  EXPECT_THAT(lab.at(20, -1.5), ElementsAre(1.0f))
      << "1.5 m above the pit's ground, not below z = 0";
  EXPECT_THAT(lab.at(-10, 0.4), ElementsAre(FloatNear(0.4f, 1e-6f))) << "no ground: above z = 0";
}

TEST(TerrainHeight, EveryFrameHasItsOwnHeight) {
  auto cfg = height();
  cfg->frame = {{"body", "foot", "r"}, {"site", "toe", "r"}};
  // The toe is 0.1 m below the foot in the foot's axes. When the foot lies on its side, both have
  // the same height.
  EXPECT_THAT(HeightLab(cfg).at(-2, 0.5), Pointwise(FloatNear(1e-6f), {0.5f, 0.5f}));
}

}  // namespace
}  // namespace mjsense::sensors
