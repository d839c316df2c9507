// SPDX-License-Identifier: Apache-2.0
// Compares shadows with MuJoCo's rays in random scenes: skipping casters that cannot occlude a
// point must not change the image.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "mjsense/core/system/cpu.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::kDark;
using testing::kMatte;
using testing::Picture;
using testing::TestRenderer;

struct Lot {
  std::mt19937 random;
  double in(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  }
  std::string numbers(int count, double low, double high) {
    std::string out;
    for (int i = 0; i < count; ++i) out += std::to_string(in(low, high)) + " ";
    return out;
  }
};

// Objects around the origin above a floor, a wall that faces the camera, which looks along `yaw`,
// and a light among or above them.
std::string scene(Lot& lot, const std::string& light, double yaw) {
  std::string xml = std::string(kDark) + kMatte;
  xml += R"(<asset><mesh name="ball" builtin="sphere" params="3"/>
    <mesh name="ring" builtin="supertorus" params="24 .4 1 1" scale=".3 .3 .3"/>
    <mesh name="board" vertex="-.5 -.02 -.3 .5 -.02 -.3 -.5 .02 -.3 .5 .02 -.3
      -.5 -.02 .3 .5 -.02 .3 -.5 .02 .3 .5 .02 .3"/></asset><worldbody>)";
  const auto geom = [&](const std::string& shape) {
    xml += "<geom material='matte' pos='" + lot.numbers(2, -0.8, 0.8) +
           std::to_string(lot.in(0.1, 1.2)) + "' euler='" + lot.numbers(3, -180, 180) + "' " +
           shape + "/>";
  };
  for (const char* type : {"sphere", "capsule", "ellipsoid", "cylinder", "box", "box"})
    geom("type='" + std::string(type) + "' size='" + lot.numbers(3, 0.03, 0.25) + "'");
  for (int i = 0; i < 2; ++i) geom("type='mesh' mesh='board'");
  geom("type='mesh' mesh='ball'");
  geom("type='mesh' mesh='ring'");
  xml += "<geom name='wall' type='plane' size='.4 .5 1' material='matte' pos='" +
         lot.numbers(2, -0.5, 0.5) + "0.5' zaxis='" + std::to_string(std::sin(yaw)) + " " +
         std::to_string(-std::cos(yaw)) + " " + std::to_string(lot.in(0, 0.5)) + "'/>";
  xml += "<geom type='plane' size='" + std::string(lot.in(0, 1) < 0.5 ? "0 0 1" : "1 2 1") +
         "' material='matte'/>";
  xml += "<light " + light + " pos='" + lot.numbers(2, -1, 1) + std::to_string(lot.in(0.8, 2.5)) +
         "' dir='" + lot.numbers(2, -0.7, 0.7) + "-1' diffuse='1 1 1' specular='0 0 0'/>";
  return xml + "</worldbody>";
}

// Whether the light reaches p, slightly above a surface with normal n. -1 if undecided: MuJoCo's
// rays from around p disagree, or the light grazes the surface.
int reached(const TestRenderer& s, const double* p, const double* n) {
  const mjModel* m = s.model.get();
  const double *pos = s.data->light_xpos, *dir = s.data->light_xdir;
  const bool directional = m->light_type[0] == mjLIGHT_DIRECTIONAL;
  double l[3], length = 0, end = 0;
  for (int i = 0; i < 3; ++i) {
    l[i] = directional ? -dir[i] : pos[i] - p[i];
    length += l[i] * l[i];
    end += dir[i] * (p[i] - pos[i]);
  }
  length = std::sqrt(length);
  double facing = 0, axis = 0;
  for (int i = 0; i < 3; ++i) {
    l[i] /= length;
    facing += l[i] * n[i];
    axis -= l[i] * dir[i];
  }
  if (facing < 0) return facing < -1e-3 ? 0 : -1;
  if (facing < 0.05) return -1;
  if (!directional) end = length;
  if (m->light_type[0] == mjLIGHT_SPOT) {
    const double angle = std::acos(axis) * 180 / mjPI - m->light_cutoff[0];
    if (angle > -0.1) return angle > 0.1 ? 0 : -1;
  }
  // MuJoCo's rays pass through planes from behind, light does not.
  const int wall = mj_name2id(m, mjOBJ_GEOM, "wall");
  double before = 0;
  for (int i = 0; i < 3; ++i)
    before += s.data->geom_xmat[9 * wall + 3 * i + 2] * (p[i] - s.data->geom_xpos[3 * wall + i]);
  if (before < -1e-3) return -1;
  int lit = 0, rays = 0;
  for (double x : {-2e-3, 0.0, 2e-3})
    for (double y : {-2e-3, 0.0, 2e-3}) {
      const double from[3] = {p[0] + 1e-3 * n[0] + x, p[1] + 1e-3 * n[1] + y, p[2] + 1e-3 * n[2]};
      const double hit = mj_ray(m, s.data.get(), from, l, nullptr, 1, -1, nullptr, nullptr);
      lit += hit < 0 || hit >= end;
      ++rays;
    }
  return lit == rays ? 1 : lit == 0 ? 0 : -1;
}

TEST(Shadow, AgreesWithMuJoCosRays) {
  constexpr int kSize = 40;
  int compared[2] = {};
  std::vector<RenderTiles> kernels{render_tiles_portable};
  if constexpr (kHasAvx) {
    if (cpu_isa() >= Isa::kAvx2) kernels.push_back(render_tiles_avx2);
    if (cpu_isa() >= Isa::kAvx512) kernels.push_back(render_tiles_avx512);
  }
  for (const char* light : {"type='directional'", "type='spot' cutoff='40' exponent='0'",
                            "type='spot' cutoff='80' exponent='0'", "type='point'"}) {
    for (unsigned seed = 0; seed < 24; ++seed) {
      Lot lot{std::mt19937(seed)};
      const double yaw = lot.in(0, 6.28), c = std::cos(yaw), d = std::sin(yaw);
      TestRenderer s(scene(lot, light, yaw));
      s.options.shadows = true;
      s.render = kernels[seed % kernels.size()];
      const double h = std::sqrt(0.5);
      const std::array<double, 3> at{1.6 * d, -1.6 * c, 2.0}, x{c, d, 0}, y{-d * h, c * h, h};
      const bool orthographic = seed % 4 == 3;
      const Picture picture = s.take(at, x, y,
                                     grid_from_fovy(kSize, kSize,
                                                    orthographic ? 2.5
                                                    : seed % 2   ? 10
                                                                 : 60,
                                                    orthographic));
      const double z[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2],
                           x[0] * y[1] - x[1] * y[0]};
      for (int i = 0; i < kSize * kSize; ++i) {
        if (picture.ids[2 * i] < 0) continue;
        double p[3], n[3];
        for (int k = 0; k < 3; ++k) {
          const float *q = &picture.points[3 * i], *m = &picture.normals[3 * i];
          p[k] = at[k] + x[k] * q[0] + y[k] * q[1] + z[k] * q[2];
          n[k] = x[k] * m[0] + y[k] * m[1] + z[k] * m[2];
        }
        const int want = reached(s, p, n);
        if (want < 0) continue;
        ++compared[want];
        ASSERT_EQ(picture.rgb[3 * i] > 0, want == 1)
            << light << ", seed " << seed << ", pixel " << i % kSize << " " << i / kSize
            << ", geom " << picture.ids[2 * i];
      }
    }
  }
  EXPECT_GT(compared[0], 10000);
  EXPECT_GT(compared[1], 10000);
}

}  // namespace
}  // namespace mjsense::render
