// SPDX-License-Identifier: Apache-2.0
// Lit and shadowed pixels, compared with single rays to the light.

#include <gtest/gtest.h>

#include <cmath>

#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/testing/render_image.h"

namespace mjsense::sensors {
namespace {

constexpr int kSize = 64;
constexpr double kLightHeight = 6;

// Hills with objects on them, and one light at `elevation` degrees above the horizon.
std::string hills(Rng& rng, double elevation, bool spot) {
  constexpr int n = 40;
  std::string heights;
  for (int r = 0; r < n; ++r)
    for (int c = 0; c < n; ++c)
      heights += testing::vec({1 + std::sin(0.5 * c) * std::cos(0.4 * r) + rng.uniform(0, 0.1)});
  const double a = elevation * M_PI / 180, b = rng.uniform(-3, 3);
  const double d[3] = {-std::cos(a) * std::cos(b), -std::cos(a) * std::sin(b), -std::sin(a)};
  const double far = kLightHeight / std::sin(a);
  const std::string light = "<light pos='" + testing::vec({-far * d[0], -far * d[1], -far * d[2]}) +
                            "' dir='" + testing::vec({d[0], d[1], d[2]}) +
                            "' ambient='0 0 0' diffuse='1 1 1' specular='0 0 0' " +
                            (spot ? "cutoff='60' exponent='0'" : "type='directional'") + "/>";
  return "<mujoco><visual><headlight active='0'/></visual><asset>"
         "<hfield name='hills' nrow='40' ncol='40' size='2 2 .5 .1' elevation='" +
         heights + "'/><mesh name='rock' vertex='-.3 -.3 0 .3 -.3 0 .3 .3 0 -.3 .3 0 0 0 .5'/>" +
         "</asset><worldbody>" + light +
         "<geom type='hfield' hfield='hills'/>"
         "<geom type='mesh' mesh='rock' pos='.4 .3 .4'/>"
         "<geom type='sphere' size='.3' pos='-.7 .5 .7'/>"
         "<geom type='box' size='.2 .3 .4' pos='.3 -.8 .5' euler='10 20 30'/>"
         "<geom type='capsule' size='.1 .4' pos='-.5 -.6 .8' euler='60 20 30'/>"
         "<camera name='c' pos='0 -1 4' euler='15 0 0' fovy='50'/></worldbody></mujoco>";
}

TEST(CameraShadows, FallWhereTheRayToTheLightIsBlocked) {
  long pixels = 0, dark = 0, wrong = 0;
  for (int scene = 0; scene < 12; ++scene) {
    Rng rng(11, 0, 1, scene);
    const double elevation[] = {8, 20, 35, 50, 65, 80};
    TestModel m(hills(rng, elevation[scene % 6], scene >= 6));
    rays::RayScene rays(m.model, 1);
    rays.update(m.world());
    CameraSensorCfg cfg;
    cfg.name = "cam";
    cfg.camera_name = "c";
    cfg.width = cfg.height = kSize;
    cfg.data_types = {"rgb", "normals", "point_cloud"};
    cfg.use_shadows = true;
    const auto camera = testing::shoot(cfg, m, rays);
    const auto rgb = camera->field("rgb").data.row<std::uint8_t>(0);
    const auto normals = camera->field("normals").data.row<float>(0);
    const auto points = camera->field("point_cloud").data.row<float>(0);
    const double *r = m.data->cam_xmat, *eye = m.data->cam_xpos;
    for (int i = 0; i < kSize * kSize; ++i) {
      if (std::isnan(points[3 * i])) continue;
      double p[3], n[3], to_light[3];
      mju_mulMatVec3(
          p, r, std::array<double, 3>{points[3 * i], points[3 * i + 1], points[3 * i + 2]}.data());
      mju_mulMatVec3(
          n, r,
          std::array<double, 3>{normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]}.data());
      for (int k = 0; k < 3; ++k) p[k] += eye[k] + 1e-4 * n[k];
      for (int k = 0; k < 3; ++k)
        to_light[k] = scene >= 6 ? m.data->light_xpos[k] - p[k] : -m.data->light_xdir[k];
      mju_normalize3(to_light);
      const double facing = mju_dot3(n, to_light);
      if (std::abs(facing) < 0.03) continue;  // too dark to distinguish
      rays::RayFilter filter;
      const bool barred = rays.trace(0, filter, p, to_light).geom >= 0;
      const bool lit = facing > 0 && !barred;
      ++pixels;
      dark += !lit;
      wrong += lit != (rgb[3 * i] > 1);
    }
  }
  EXPECT_GT(pixels, 30000);
  EXPECT_GT(dark, pixels / 20);
  EXPECT_LT(wrong, pixels / 500);  // edges of shadows
}

}  // namespace
}  // namespace mjsense::sensors
