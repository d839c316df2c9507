// SPDX-License-Identifier: Apache-2.0
// Frustum culling must not change any pixel.

#include "mjsense/render/view/frustum.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "mjsense/core/rng.h"
#include "mjsense/rays/box_list.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::kAmbient;
using testing::Picture;
using testing::TestRenderer;

// `count` shapes around the origin, every tenth on a moving body, on an infinite plane.
std::string crowd(int count, const std::string& lights = "") {
  Rng rng(3, 0, 0, 0);
  const char* types[] = {"box", "sphere", "capsule", "ellipsoid", "cylinder"};
  std::string xml = (lights.empty() ? kAmbient : "") + ("<worldbody>" + lights) +
                    "<geom type='plane' size='0 0 1'/>";
  for (int i = 0; i < count; ++i) {
    const std::string geom =
        fmt::format("<geom type='{}' size='{} {} {}' rgba='{} .5 .5 {}'/>", types[i % 5],
                    rng.uniform(0.05, 0.4), rng.uniform(0.05, 0.4), rng.uniform(0.05, 0.4),
                    rng.uniform(0, 1), i % 7 == 0 ? 0.5 : 1.0);
    xml += fmt::format("<body pos='{} {} {}' euler='{} {} 0'>{}{}</body>", rng.uniform(-12, 12),
                       rng.uniform(-12, 12), rng.uniform(0, 3), rng.uniform(0, 90),
                       rng.uniform(0, 90), i % 10 == 0 ? "<freejoint/>" : "", geom);
  }
  return xml + "</worldbody>";
}

struct Eye {
  std::array<double, 3> at, x, y;
};

// Horizontal camera, rotated by `yaw` and looking down by `pitch`.
Eye eye(std::array<double, 3> at, double yaw, double pitch) {
  const double c = std::cos(yaw), s = std::sin(yaw);
  return {at, {c, s, 0}, {-s * std::sin(pitch), c * std::sin(pitch), std::cos(pitch)}};
}

void expect_nothing_missed(TestRenderer& s, const Eye& e, const PixelGrid& grid) {
  s.options.disable_culling = true;
  const Picture all = s.take(e.at, e.x, e.y, grid);
  s.options.disable_culling = false;
  const Picture seen = s.take(e.at, e.x, e.y, grid);
  EXPECT_EQ(all.rgb, seen.rgb);
  EXPECT_EQ(all.depth, seen.depth);
  EXPECT_EQ(all.ids, seen.ids);
  EXPECT_EQ(all.normals, seen.normals);
}

int in_view(TestRenderer& s, const Eye& e, const PixelGrid& grid) {
  std::vector<std::uint64_t> candidates((s.model->ngeom + 63) / 64);
  const std::array<double, 3>&x = e.x, &y = e.y;
  double r[9];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    r[3 * i] = x[i];
    r[3 * i + 1] = y[i];
    r[3 * i + 2] = x[j] * y[k] - x[k] * y[j];
  }
  find_candidates(s.rays->world(0).boxes(), Frustum(grid, e.at.data(), r), candidates);
  int count = 0;
  for (const std::uint64_t word : candidates) count += __builtin_popcountll(word);
  return count;
}

TEST(Frustum, CullingDoesNotChangeImages) {
  for (const int count : {60, 700}) {  // tested one by one, and in blocks
    SCOPED_TRACE(count);
    TestRenderer s(crowd(count));
    s.update();
    const PixelGrid pyramid = grid_from_fovy(48, 32, 50, false);
    PixelGrid slab = grid_from_fovy(48, 32, 8, true);
    slab.orthographic = true;
    int maximum = 0;
    for (int k = 0; k < 12; ++k) {
      SCOPED_TRACE(k);
      const Eye e = eye({3.0 * (k % 3 - 1), 2.0 * (k % 5 - 2), 1.5}, 0.6 * k, -0.2 * (k % 3));
      expect_nothing_missed(s, e, pyramid);
      expect_nothing_missed(s, e, slab);
      maximum = std::max(maximum, in_view(s, e, pyramid));
    }
    EXPECT_LT(maximum, s.model->ngeom / 2);  // otherwise culling saves nothing
    EXPECT_GT(maximum, 5);
  }
}

// Lights of every kind at random poses: near and far, in the image and behind the camera.
TEST(Frustum, CullingDoesNotChangeShadows) {
  const char* kinds[] = {"type='directional'", "type='spot' cutoff='60'", "type='point'"};
  const PixelGrid pyramid = grid_from_fovy(48, 32, 50, false);
  PixelGrid slab = grid_from_fovy(48, 32, 8, true);
  slab.orthographic = true;
  int passed_by = 0, shaded = 0;
  for (const int count : {60, 700}) {
    for (int k = 0; k < 18; ++k) {
      SCOPED_TRACE(fmt::format("{} {}", count, k));
      Rng rng(5, k, 0, 0);
      std::string lights;
      for (int i = 0; i < 1 + k % 3; ++i) {
        const double x = rng.uniform(-9, 9), y = rng.uniform(-9, 9), z = rng.uniform(1, 7);
        lights += fmt::format("<light {} castshadow='true' pos='{} {} {}' dir='{} {} {}'/>",
                              kinds[(i + k) % 3], x, y, z, rng.uniform(-1, 1), rng.uniform(-1, 1),
                              rng.uniform(-1, -0.1));
      }
      TestRenderer s(testing::kDark + crowd(count, lights));
      s.update();
      s.options.shadows = true;
      const Eye e = eye({3.0 * (k % 3 - 1), 2.0 * (k % 5 - 2), 1.5}, 0.6 * k, -0.2 * (k % 3));
      expect_nothing_missed(s, e, pyramid);
      expect_nothing_missed(s, e, slab);
      ViewBuilder builder(s.model.get(), *s.assets, s.options);
      passed_by += s.view(builder, e.at, e.x, e.y, pyramid).num_geoms < s.model->ngeom;
      const Picture dark = s.take(e.at, e.x, e.y, pyramid);
      s.options.shadows = false;
      shaded += dark.rgb != s.take(e.at, e.x, e.y, pyramid).rgb;
    }
  }
  EXPECT_GT(passed_by, 24);  // otherwise culling saves nothing
  EXPECT_GT(shaded, 24);     // otherwise no shadow is tested
}

// A small box outside the image casts a shadow 20 m away, on a plane or on another box.
TEST(Frustum, KeepsCastersOfLongShadows) {
  struct Case {
    const char *what, *dir;
    Eye eye;
  };
  const Case cases[] = {
      {"<geom type='plane' size='0 0 1'/>", "1 0 -.1", {{20, 0, 3}, {1, 0, 0}, {0, 1, 0}}},
      {"<geom type='box' size='.1 4 4' pos='20 0 0'/>",
       "1 0 0",
       {{17, 0, 2}, {0, -1, 0}, {0, 0, 1}}},
  };
  for (const Case& c : cases) {
    SCOPED_TRACE(c.what);
    TestRenderer s(fmt::format(
        "{}<worldbody><light type='directional' castshadow='true' diffuse='5 5 5' pos='-9 0 9' "
        "dir='{}'/>{}<geom type='box' size='.3 .3 .3' pos='0 0 2'/></worldbody>",
        testing::kDark, c.dir, c.what));
    s.update();
    const PixelGrid grid = grid_from_fovy(16, 16, 20, false);
    const auto center = [&] { return s.take(c.eye.at, c.eye.x, c.eye.y, grid).at(8, 8); };
    const testing::Pixel lit = center();
    s.options.shadows = true;
    EXPECT_GT(lit[0], 30);
    EXPECT_LT(center()[0], 5);
    expect_nothing_missed(s, c.eye, grid);
  }
}

// Culling depends neither on earlier poses nor on earlier sizes.
TEST(Frustum, GeomsThatMoveIntoTheImageAreVisible) {
  for (const int count : {60, 700}) {
    TestRenderer s(crowd(count));
    s.update();
    const Eye e = eye({0, -14, 1.5}, 0, 0);
    const PixelGrid grid = grid_from_fovy(48, 32, 30, false);
    const auto sees = [&](int geom) {
      const Picture p = s.take(e.at, e.x, e.y, grid);
      return std::find(p.ids.begin(), p.ids.end(), geom) != p.ids.end();
    };
    const int geom = 1, joint = s.model->body_jntadr[s.model->geom_bodyid[geom]];
    double* q = s.data->qpos + s.model->jnt_qposadr[joint];
    const auto place = [&](double x, double y) {
      q[0] = x;
      q[1] = y;
      q[2] = 1.5;
      s.update();
    };
    for (int again = 0; again < 2; ++again) {
      place(0, -30);  // behind the camera
      EXPECT_FALSE(sees(geom));
      place(0, -12);
      EXPECT_TRUE(sees(geom));
      expect_nothing_missed(s, e, grid);
      place(6, -6);  // outside the image
      EXPECT_FALSE(sees(geom));
      const double size = s.model->geom_size[3 * geom];
      // Now it reaches into the image.
      for (int k = 0; k < 3; ++k) s.model->geom_size[3 * geom + k] = 5;
      s.update();
      EXPECT_TRUE(sees(geom));
      for (int k = 0; k < 3; ++k) s.model->geom_size[3 * geom + k] = size;
      mj_resetData(s.model.get(), s.data.get());
      s.update();
      expect_nothing_missed(s, e, grid);
    }
  }
}

}  // namespace
}  // namespace mjsense::render
