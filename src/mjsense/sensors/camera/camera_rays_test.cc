// SPDX-License-Identifier: Apache-2.0
// Images compared with single rays of the ray scene: every pixel of random scenes with every geom
// type.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/reference.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/testing/render_image.h"

namespace mjsense::sensors {
namespace {

// Configuration of the scene's camera "c".
CameraSensorCfg camera_c(int width, int height, std::vector<std::string> data_types) {
  CameraSensorCfg cfg;
  cfg.name = "cam";
  cfg.camera_name = "c";
  cfg.width = width;
  cfg.height = height;
  cfg.data_types = std::move(data_types);
  return cfg;
}

// Calls visit(pixel, d, length) with each pixel's direction in the world. The pixel's depth is the
// distance along the ray divided by `length`.
template <class Visit>
void each_pixel(const TestModel& m, int width, int height, double fovy, Visit visit) {
  const double top = std::tan(0.5 * fovy * M_PI / 180), right = top * width / height;
  for (int i = 0; i < width * height; ++i) {
    const int x = i % width, y = i / width;
    const double c[3] = {right * (2 * (x + 0.5) / width - 1), top * (1 - 2 * (y + 0.5) / height),
                         -1};
    double d[3];
    mju_mulMatVec3(d, m.data->cam_xmat, c);
    const double length = mju_normalize3(d);
    visit(i, d, length);
  }
}

TEST(CameraAgainstRays, EveryPixelEqualsItsRay) {
  constexpr int kWidth = 61, kHeight = 47, kScenes = 24;
  long pixels = 0, other_geom = 0, hits = 0, off = 0;
  for (int scene = 0; scene < kScenes; ++scene) {
    Rng rng(7, 0, 1, scene);
    std::string xml = testing::random_scene(
        rng, {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "hfield"}, 40,
        2.5);
    const std::string end = "</worldbody>";
    // Every second camera is among the geoms, with triangles on its sides and behind it.
    const double far = scene % 2 == 0 ? 4 : 1;
    const std::string eye = testing::vec(
        {rng.uniform(-far, far), rng.uniform(-far, far), far / 4 + rng.uniform(0, 0.75 * far)});
    const std::string turn =
        testing::vec({rng.uniform(20, 70), rng.uniform(-30, 30), rng.uniform(-180, 180)});
    xml.insert(xml.find(end),
               "<camera name='c' pos='" + eye + "' euler='" + turn + "' fovy='70'/>");
    TestModel m(xml);
    rays::RayScene rays(m.model, 1);
    rays.update(m.world());
    const auto camera =
        testing::shoot(camera_c(kWidth, kHeight, {"depth", "segmentation"}), m, rays);
    const auto depth = camera->field("depth").data.row<float>(0);
    const auto ids = camera->field("segmentation").data.row<std::int32_t>(0);

    rays::RayFilter filter;
    filter.groups = 0x7;
    filter.backfaces = rays::RayFilter::Backfaces::kCull;
    each_pixel(m, kWidth, kHeight, 70, [&](int i, const double* d, double length) {
      const rays::Hit hit = rays.trace(0, filter, m.data->cam_xpos, d);
      const double planar = hit.t / length;
      ++pixels;
      hits += hit.geom >= 0;
      if (ids[2 * i] != hit.geom) {
        ++other_geom;
      } else if (hit.geom >= 0) {
        // On a plane far away, rounding of the direction moves the hit by the distance squared.
        const double rounding = 1e-5 * (1 + planar) + 1e-7 * planar * planar;
        off += std::abs(depth[i] - planar) > rounding;
      }
    });
  }
  EXPECT_GT(hits, pixels / 4);
  EXPECT_LT(other_geom, pixels / 5000);  // edges, because of rounding
  EXPECT_LT(off, pixels / 5000);
}

// Depth compared with mj_ray, over ground that is flat at its highest elevation. Such a top is in
// the plane in which the height field's box ends, and must be visible in images too.
TEST(CameraAgainstRays, FlatTopsOfHeightFields) {
  constexpr int kWidth = 64, kHeight = 48;
  long pixels = 0, off = 0, ground = 0;
  for (int scene = 0; scene < 12; ++scene) {
    Rng rng(8, 0, 1, scene);
    std::string heights;
    for (int i = 0; i < 14 * 11; ++i)
      heights += testing::vec({std::floor(std::clamp(rng.uniform(-1, 2), 0.0, 1.0) * 4) / 4});
    const TestModel m(
        "<mujoco><asset><hfield name='ground' nrow='14' ncol='11' size='2 1.5 .4 .1' elevation='" +
        heights + "'/></asset><worldbody><body pos='" +
        testing::vec({rng.uniform(-9, 9), rng.uniform(-9, 9), rng.uniform(-9, 9)}) + "' euler='" +
        (scene % 2 ? testing::vec({rng.uniform(-9, 9), rng.uniform(-9, 9), 0}) : "0 0 0") +
        "'><geom type='hfield' hfield='ground'/><camera name='c' fovy='60' pos='" +
        testing::vec({rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(1, 3)}) + "' euler='" +
        (scene % 3 ? testing::vec({rng.uniform(-40, 40), rng.uniform(-40, 40), 20}) : "0 0 0") +
        "'/></body></worldbody></mujoco>");
    rays::RayScene rays(m.model, 1);
    rays.update(m.world());
    const auto camera = testing::shoot(camera_c(kWidth, kHeight, {"depth"}), m, rays);
    const auto depth = camera->field("depth").data.row<float>(0);
    each_pixel(m, kWidth, kHeight, 60, [&](int i, const double* d, double length) {
      const testing::Reference truth = testing::mujoco_ray(m, m.data->cam_xpos, d);
      ++pixels;
      if (truth.t < 0) return;
      ++ground;
      off += std::abs(depth[i] - truth.t / length) > 1e-5 * (1 + truth.t);
    });
  }
  EXPECT_GT(ground, pixels / 3);
  EXPECT_LT(off, pixels / 5000);  // edges of steps, because of rounding
}

}  // namespace
}  // namespace mjsense::sensors
