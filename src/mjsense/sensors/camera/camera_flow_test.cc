// SPDX-License-Identifier: Apache-2.0
// Optical flow of CameraSensor: where each pixel's surface point was in the previous image.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense/sensors/testing/lab.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

constexpr int kWidth = 40, kHeight = 30;
constexpr double kFocal = 15;  // pixels; fovy is 90 degrees

// A camera on three slides and a ball joint, 2 m in front of a wall, looks along -z at a plate 1 m
// away, which is on a slide. There is no gravity: nothing moves unless its pose is written.
constexpr char kWorld[] = R"(
<mujoco>
  <worldbody>
    <geom name="wall" type="plane" size="20 20 .1"/>
    <body name="head" pos="0 0 2">
      <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
      <joint name="z" type="slide" axis="0 0 1"/><joint name="turn" type="ball"/>
      <geom size=".01" mass="1" contype="0" conaffinity="0" group="5"/>
      <camera name="eye" fovy="90"/>
    </body>
    <body name="plate" pos="0 0 .9">
      <joint name="plate" type="slide" axis="1 0 0"/>
      <geom name="plate" type="box" size=".2 .2 .1" mass="1" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>)";
enum { kX, kY, kZ, kTurn, kPlate = 7 };  // addresses in qpos

std::shared_ptr<CameraSensorCfg> flow_camera(std::vector<std::string> types = {"flow"}) {
  auto cfg = std::make_shared<CameraSensorCfg>();
  cfg->name = "cam";
  cfg->camera_name = "w/eye";
  cfg->width = kWidth;
  cfg->height = kHeight;
  cfg->data_types = std::move(types);
  return cfg;
}

struct FlowLab : testing::Lab {
  explicit FlowLab(std::shared_ptr<CameraSensorCfg> camera, sim::SimulationCfg cfg = {})
      : Lab(scene_with(std::move(camera)), cfg) {}

  static scene::SceneCfg scene_with(std::shared_ptr<CameraSensorCfg> camera) {
    scene::SceneCfg s = scene_of("w", kWorld, {std::move(camera)});
    s.options.gravity = {0, 0, 0};
    return s;
  }
  template <class T = float>
  std::vector<T> read(std::string_view field = "flow", int world = 0) {
    return Lab::read<T>(field, "cam", world);
  }
  void turn(double angle, double x, double y, double z) {
    const double s = std::sin(angle / 2), n = std::sqrt(x * x + y * y + z * z);
    const double q[4] = {std::cos(angle / 2), s * x / n, s * y / n, s * z / n};
    std::copy_n(q, 4, qpos() + kTurn);
  }
};

template <class Check>
void for_pixels(const std::vector<float>& flow, Check&& check) {
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      const int i = 2 * (y * kWidth + x);
      check(x, y, flow[i], flow[i + 1]);
    }
}

TEST(Flow, IsZeroInTheFirstImageAndWhileNothingMoves) {
  FlowLab lab(flow_camera());
  for (float f : lab.read()) EXPECT_EQ(f, 0);
  lab.sim->step();
  for (float f : lab.read()) EXPECT_EQ(f, 0);
}

//   before -> now      wall
//    o     o        |
//    \ dx /         |  z
TEST(Flow, OfATranslatingCameraIsFocalTimesDistanceOverDepth) {
  FlowLab lab(flow_camera());
  lab.read();
  lab.qpos()[kX] = 0.1;
  lab.qpos()[kY] = -0.04;
  lab.sim->forward();
  const auto flow = lab.read();
  for_pixels(flow, [](int x, int y, float u, float v) {
    if (std::abs(x - kWidth / 2) < 8 && std::abs(y - kHeight / 2) < 8) return;
    // In the image before, a static point was to the right by f dx / z; v points down.
    EXPECT_NEAR(u, kFocal * 0.1 / 2, 1e-4) << x << ", " << y;
    EXPECT_NEAR(v, kFocal * 0.04 / 2, 1e-4) << x << ", " << y;
  });
  const int middle = 2 * (kHeight / 2 * kWidth + kWidth / 2 - 2);
  EXPECT_NEAR(flow[middle], kFocal * 0.1 / 1.0, 1e-4);  // the plate's front is at 1 m
  EXPECT_NEAR(flow[middle + 1], kFocal * 0.04 / 1.0, 1e-4);
}

TEST(Flow, OfAMovingObjectFollowsItsMotion) {
  FlowLab lab(flow_camera());
  lab.read();
  lab.qpos()[kPlate] = 0.05;
  lab.sim->forward();
  int moving = 0;
  for_pixels(lab.read(), [&](int x, int y, float u, float v) {
    EXPECT_EQ(v, 0) << x << ", " << y;
    if (u == 0) return;
    ++moving;
    EXPECT_NEAR(u, -kFocal * 0.05 / 1.0, 1e-4);  // the plate was to the left
  });
  EXPECT_EQ(moving, 6 * 6);  // 0.4 m at 1 m are 6 pixels
}

TEST(Flow, IncludesTeleports) {
  FlowLab lab(flow_camera());
  lab.sim->step();
  lab.read();
  lab.sim->step();
  lab.qpos()[kPlate] = -1.0;
  lab.sim->forward();
  bool seen = false;
  for_pixels(lab.read(), [&](int, int, float u, float) { seen |= std::abs(u - kFocal) < 1e-3; });
  EXPECT_TRUE(seen);
}

// Computes every pixel in another way: the pixel's point of the point cloud is transformed to the
// world, moved back by the plate's motion, and projected into the previous image by the formulas of
// CameraSensorCfg.
void expect_flow_of_point_cloud(const std::shared_ptr<CameraSensorCfg>& cfg, double focal) {
  FlowLab lab(cfg);
  lab.qpos()[kX] = 0.2;
  lab.turn(0.1, 1, -1, 2);
  lab.sim->forward();
  const auto x_before = lab.read("pose");
  lab.qpos()[kX] = -0.05;
  lab.qpos()[kZ] = 0.1;
  lab.qpos()[kPlate] = 0.07;
  lab.turn(0.13, 2, 1, -3);
  lab.sim->forward();
  const auto flow = lab.read(), points = lab.read("point_cloud"), x_now = lab.read("pose");
  const auto ids = lab.read<std::int32_t>("segmentation");
  int far_out = 0, plate = 0;
  for_pixels(flow, [&](int x, int y, float u, float v) {
    const int i = y * kWidth + x;
    double w[3], p[3];
    for (int k = 0; k < 3; ++k) {
      w[k] = x_now[4 * k + 3];
      for (int j = 0; j < 3; ++j) w[k] += x_now[4 * k + j] * points[3 * i + j];
    }
    const std::string geom = mj_id2name(lab.sim->model(), mjOBJ_GEOM, ids[2 * i]);
    if (geom == "w/plate") {
      w[0] -= 0.07;
      ++plate;
    }
    for (int k = 0; k < 3; ++k) {
      p[k] = 0;
      for (int j = 0; j < 3; ++j) p[k] += x_before[4 * j + k] * (w[j] - x_before[4 * j + 3]);
    }
    double right = p[0], down = -p[1];
    if (!cfg->orthographic) {
      right /= -p[2];
      down /= -p[2];
    }
    const double r2 = right * right + down * down;
    const auto& k = cfg->distortion.coefficients;
    if (cfg->distortion.model == LensKind::kBrownConrady) {
      const double radial = 1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2;
      const double bent =
          right * radial + 2 * k[2] * right * down + k[3] * (r2 + 2 * right * right);
      down = down * radial + k[2] * (r2 + 2 * down * down) + 2 * k[3] * right * down;
      right = bent;
    } else if (cfg->distortion.model == LensKind::kFisheye) {
      const double t = std::atan(std::sqrt(r2));
      const double scale = (t + k[0] * t * t * t) / std::sqrt(r2);
      right *= scale;
      down *= scale;
    }
    if (std::isnan(u)) {  // only far outside the previous image
      EXPECT_NE(cfg->distortion.model.text(), "none");
      EXPECT_GT(std::hypot(right * focal / kWidth, down * focal / kHeight), 0.6);
      ++far_out;
      return;
    }
    EXPECT_NEAR(u, right * focal + kWidth / 2 - (x + 0.5), 2e-4) << x << ", " << y;
    EXPECT_NEAR(v, down * focal + kHeight / 2 - (y + 0.5), 2e-4) << x << ", " << y;
  });
  EXPECT_GT(plate, 10);
  EXPECT_LT(far_out, kWidth * kHeight / 10);
}

TEST(Flow, AgreesWithThePointCloudInEveryKindOfCamera) {
  auto cfg = flow_camera({"flow", "point_cloud", "segmentation"});
  expect_flow_of_point_cloud(cfg, kFocal);
  cfg->data_types.push_back("depth");
  cfg->depth_kind = "ray";
  expect_flow_of_point_cloud(cfg, kFocal);
  cfg->intrinsics = CameraIntrinsics{18, 18, kWidth / 2, kHeight / 2};
  cfg->distortion = {"brown_conrady", {-0.1, 0.02, 0.003, -0.002, 0.001}};
  expect_flow_of_point_cloud(cfg, 18);
  cfg->distortion = {"fisheye", {0.03, 0, 0, 0}};
  expect_flow_of_point_cloud(cfg, 18);
  cfg = flow_camera({"flow", "point_cloud", "segmentation"});
  cfg->orthographic = true;
  cfg->fovy = 2.0;  // m
  expect_flow_of_point_cloud(cfg, kHeight / 2.0);
}

TEST(Flow, IsNanWhereNothingIsSeenOrWasBehindTheCamera) {
  FlowLab lab(flow_camera());
  lab.qpos()[kZ] = -1.5;  // 0.5 m above the wall, below the plate's top at 1 m
  lab.sim->forward();
  lab.read();
  lab.qpos()[kZ] = 0;
  lab.sim->forward();
  int behind = 0;
  for (float f : lab.read()) behind += std::isnan(f);
  EXPECT_EQ(behind, 2 * 6 * 6);
  lab.turn(3.14159, 1, 0, 0);  // the camera looks up
  lab.sim->forward();
  for (float f : lab.read()) EXPECT_TRUE(std::isnan(f));
}

TEST(Flow, PartialResetClearsThePreviousImageOfItsWorlds) {
  FlowLab lab(flow_camera(), {.num_worlds = 2});
  lab.read();
  const auto move = [&](double x) {
    lab.qpos(0)[kX] = lab.qpos(1)[kX] = x;
    lab.sim->step();
  };
  move(0.1);
  EXPECT_NEAR(lab.read("flow", 1)[0], kFocal * 0.1 / 2, 1e-4);
  const auto of_world_0 = lab.read("flow", 0);
  const int one[] = {1};
  lab.sim->reset(one);
  for (float f : lab.read("flow", 1)) EXPECT_EQ(f, 0);
  EXPECT_EQ(lab.read("flow", 0), of_world_0);
  move(0.3);
  EXPECT_NEAR(lab.read("flow", 1)[0], kFocal * 0.3 / 2, 1e-4);
  EXPECT_NEAR(lab.read("flow", 0)[0], kFocal * 0.2 / 2, 1e-4);
}

TEST(Flow, ImageAtTheSameTimeReplacesTheLast) {
  FlowLab lab(flow_camera());
  lab.sim->step();
  lab.read();
  lab.qpos()[kX] = 0.1;
  lab.sim->step();  // an image is taken, because the sensor was read before
  lab.qpos()[kX] = 0.3;
  lab.sim->forward();
  EXPECT_NEAR(lab.read()[0], kFocal * 0.3 / 2, 1e-4);
  lab.qpos()[kX] = 0.2;
  lab.sim->forward();
  EXPECT_NEAR(lab.read()[0], kFocal * 0.2 / 2, 1e-4);
}

TEST(Flow, IsBetweenImagesOfTheCamerasOwnRate) {
  auto cfg = flow_camera();
  cfg->update_period = 0.006;  // three steps
  FlowLab lab(cfg);
  lab.qpos()[kX] = 5;  // after the reset, this is still the first image
  lab.sim->forward();
  for (float f : lab.read()) EXPECT_EQ(f, 0);
  const float whole = static_cast<float>(kFocal * 0.3 / 2);
  for (int step = 1; step <= 9; ++step) {
    lab.qpos()[kX] = 5 + 0.1 * step;
    lab.sim->step();
    EXPECT_NEAR(lab.read()[0], step < 3 ? 0 : whole, 1e-4) << step;
  }
}

TEST(Flow, UsesTrueDepth) {
  auto plain = flow_camera({"flow", "depth"}), noisy = flow_camera({"flow", "depth"});
  noisy->depth_noise = "d435";
  std::vector<float> flows[2], depths[2];
  for (int i = 0; i < 2; ++i) {
    FlowLab lab(i == 0 ? plain : noisy);
    lab.read();
    lab.qpos()[kX] = 0.1;
    lab.sim->forward();
    flows[i] = lab.read();
    depths[i] = lab.read("depth");
  }
  EXPECT_EQ(flows[0], flows[1]);
  EXPECT_NE(depths[0], depths[1]);
}

TEST(Flow, IsTheSameWithMuJoCosRenderer) {
  auto cfg = flow_camera();
  cfg->renderer = "opengl";
  try {
    FlowLab lab(cfg);
    lab.read();
    lab.qpos()[kX] = 0.1;
    lab.sim->forward();
    EXPECT_NEAR(lab.read()[0], kFocal * 0.1 / 2, 1e-3);
  } catch (const RuntimeError& e) {
    GTEST_SKIP() << e.what();
  }
}

}  // namespace
}  // namespace mjsense::sensors
