// SPDX-License-Identifier: Apache-2.0
// Images against single rays of the ray scene: every pixel of random scenes of every geom type.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/rays/testing/truth.h"
#include "mjsense/sensors/camera/testing/shoot.h"

namespace mjsense {
namespace {

TEST(CameraAgainstRays, EveryPixelSeesWhatItsRayMeets) {
  constexpr int kWidth = 61, kHeight = 47, kScenes = 24;
  long pixels = 0, other_geom = 0, hits = 0, off = 0;
  for (int scene = 0; scene < kScenes; ++scene) {
    Rng rng(7, 0, 1, scene);
    std::string xml = testing::random_scene(
        rng, {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "hfield"}, 40,
        2.5);
    const std::string end = "</worldbody>";
    // Every second camera is among the geoms: triangles pass beside and behind it.
    const double far = scene % 2 == 0 ? 4 : 1;
    const std::string eye = testing::vec(
        {rng.uniform(-far, far), rng.uniform(-far, far), far / 4 + rng.uniform(0, 0.75 * far)});
    const std::string turn =
        testing::vec({rng.uniform(20, 70), rng.uniform(-30, 30), rng.uniform(-180, 180)});
    xml.insert(xml.find(end),
               "<camera name='c' pos='" + eye + "' euler='" + turn + "' fovy='70'/>");
    testing::TestModel m(xml);
    RayScene rays(m.model, 1);
    rays.update(m.world());
    CameraSensorCfg cfg;
    cfg.name = "cam";
    cfg.camera_name = "c";
    cfg.width = kWidth;
    cfg.height = kHeight;
    cfg.data_types = {"depth", "segmentation"};
    const auto camera = testing::shoot(cfg, m, rays);
    const auto depth = camera->field("depth").data.row<float>(0);
    const auto ids = camera->field("segmentation").data.row<std::int32_t>(0);

    RayFilter filter;
    filter.groups = 0x7;
    filter.backfaces = RayFilter::Backfaces::kCull;
    const double top = std::tan(35 * M_PI / 180), right = top * kWidth / kHeight;
    const double *origin = m.data->cam_xpos, *r = m.data->cam_xmat;
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const double c[3] = {right * (2 * (x + 0.5) / kWidth - 1),
                             top * (1 - 2 * (y + 0.5) / kHeight), -1};
        double d[3];
        for (int k = 0; k < 3; ++k)
          d[k] = r[3 * k] * c[0] + r[3 * k + 1] * c[1] + r[3 * k + 2] * c[2];
        const Hit hit = rays.trace(0, filter, origin, d);
        const double planar = hit.t / std::hypot(c[0], c[1], c[2]);
        const int i = y * kWidth + x;
        ++pixels;
        hits += hit.geom >= 0;
        if (ids[2 * i] != hit.geom) {
          ++other_geom;
        } else if (hit.geom >= 0) {
          // Far away on a plane a rounded direction moves the hit by the distance squared.
          const double rounding = 1e-5 * (1 + planar) + 1e-7 * planar * planar;
          off += std::abs(depth[i] - planar) > rounding;
        }
      }
  }
  EXPECT_GT(hits, pixels / 4);
  EXPECT_LT(other_geom, pixels / 5000);  // edges, by rounding
  EXPECT_LT(off, pixels / 5000);
}

// Depth over ground that is flat at its highest elevation, by mj_ray: in an image, too, such a top
// is the plane in which the field's box ends.
TEST(CameraAgainstRays, FlatTopsOfHeightFields) {
  constexpr int kWidth = 64, kHeight = 48;
  long pixels = 0, off = 0, ground = 0;
  for (int scene = 0; scene < 12; ++scene) {
    Rng rng(8, 0, 1, scene);
    std::string heights;
    for (int i = 0; i < 14 * 11; ++i)
      heights += testing::vec({std::floor(std::clamp(rng.uniform(-1, 2), 0.0, 1.0) * 4) / 4});
    const testing::TestModel m(
        "<mujoco><asset><hfield name='ground' nrow='14' ncol='11' size='2 1.5 .4 .1' elevation='" +
        heights + "'/></asset><worldbody><body pos='" +
        testing::vec({rng.uniform(-9, 9), rng.uniform(-9, 9), rng.uniform(-9, 9)}) + "' euler='" +
        (scene % 2 ? testing::vec({rng.uniform(-9, 9), rng.uniform(-9, 9), 0}) : "0 0 0") +
        "'><geom type='hfield' hfield='ground'/><camera name='c' fovy='60' pos='" +
        testing::vec({rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(1, 3)}) + "' euler='" +
        (scene % 3 ? testing::vec({rng.uniform(-40, 40), rng.uniform(-40, 40), 20}) : "0 0 0") +
        "'/></body></worldbody></mujoco>");
    RayScene rays(m.model, 1);
    rays.update(m.world());
    CameraSensorCfg cfg;
    cfg.name = "cam";
    cfg.camera_name = "c";
    cfg.width = kWidth;
    cfg.height = kHeight;
    cfg.data_types = {"depth"};
    const auto camera = testing::shoot(cfg, m, rays);
    const auto depth = camera->field("depth").data.row<float>(0);
    const double top = std::tan(30 * M_PI / 180), right = top * kWidth / kHeight;
    const double *origin = m.data->cam_xpos, *r = m.data->cam_xmat;
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) {
        const double c[3] = {right * (2 * (x + 0.5) / kWidth - 1),
                             top * (1 - 2 * (y + 0.5) / kHeight), -1};
        double d[3];
        mju_mulMatVec3(d, r, c);
        const double length = mju_normalize3(d);
        const testing::Truth truth = testing::mujoco_ray(m, origin, d);
        ++pixels;
        if (truth.t < 0) continue;
        ++ground;
        off += std::abs(depth[y * kWidth + x] - truth.t / length) > 1e-5 * (1 + truth.t);
      }
  }
  EXPECT_GT(ground, pixels / 3);
  EXPECT_LT(off, pixels / 5000);  // edges of steps, by rounding
}

}  // namespace
}  // namespace mjsense
