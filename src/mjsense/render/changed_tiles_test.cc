// SPDX-License-Identifier: Apache-2.0
// An image of which only the changed tiles are rendered is equal to one that is rendered as a whole.

#include "mjsense/render/view/changed_tiles.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "mjsense/core/rng.h"
#include "mjsense/render/testing/test_renderer.h"

namespace mjsense::render {
namespace {

using testing::Picture;
using testing::TestRenderer;

// Views are compared member by member. A constant expression must not read a member without a value.
template <typename T>
constexpr bool equal_to_another() {
  T a, b;
  return a == b;
}
static_assert(equal_to_another<PixelGrid>() && equal_to_another<Fog>() && equal_to_another<Haze>());

constexpr int kBodies = 40;

// Free bodies, some transparent, on a floor that reflects or does not, under lights with shadows.
std::string crowd(const std::string& lights, double reflectance) {
  Rng rng(5, 0, 0, 0);
  const char* shapes[] = {"box", "sphere", "capsule", "ellipsoid", "cylinder", "mesh' mesh='ball"};
  std::string xml = fmt::format(
      "<asset><material name='floor' rgba='.6 .6 .7 1' reflectance='{}'/>"
      "<mesh name='ball' builtin='sphere' params='4' scale='.2 .1 .6'/>"
      "<texture type='skybox' builtin='gradient' rgb1='.3 .5 .7' rgb2='0 0 0' width='32' "
      "height='32'/></asset><worldbody>{}<geom type='plane' size='0 0 1' material='floor'/>",
      reflectance, lights);
  for (int i = 0; i < kBodies; ++i)
    xml += fmt::format(
        "<body pos='{} {} {}' euler='{} {} 0'><freejoint/><geom type='{}' size='{} .1 {}' rgba='{} "
        ".5 .5 {}'/></body>",
        rng.uniform(-3, 3), rng.uniform(-3, 3), rng.uniform(.2, 2), rng.uniform(0, 90),
        rng.uniform(0, 90), shapes[i % 6], rng.uniform(.05, .4), rng.uniform(.05, .4),
        rng.uniform(0, 1), i % 7 == 0 ? .5 : 1.);
  return xml + "</worldbody>";
}

struct Case {
  std::string lights;
  double reflectance;
  bool shadows, multisampled;
};

class ChangedTilesOf : public ::testing::TestWithParam<Case> {};

TEST_P(ChangedTilesOf, ImagesAreEqual) {
  const Case& c = GetParam();
  TestRenderer s(crowd(c.lights, c.reflectance));
  s.options.shadows = c.shadows;
  s.options.reflections = true;
  s.update();
  ViewBuilder builder(s.model.get(), *s.assets, s.options);
  const PixelGrid grid = grid_from_fovy(150, 130, 60, false);
  Picture kept(150, 130), whole(150, 130);
  const auto targets_of = [&](Picture& picture) {
    ImageTargets targets = picture.targets();
    targets.samples = 4;
    if (!(targets.multisampled = c.multisampled)) return targets;
    targets.depth = targets.normals = targets.points = nullptr;
    targets.segmentation = nullptr;
    return targets;
  };
  ChangedTiles tiles;
  Rng rng(7, 0, 0, 0);
  double side = 0;
  int changed = 0, all = 0;
  for (int image = 0; image < 40; ++image) {
    if (image % 10 == 9) side += .1;  // the camera moves
    const int moved = image % 10 == 5 ? 0 : 1 + static_cast<int>(rng.uniform(0, 3));
    for (int i = 0; i < moved; ++i) {
      double* qpos = s.data->qpos + 7 * static_cast<int>(rng.uniform(0, kBodies));
      for (int k = 0; k < 3; ++k) qpos[k] += rng.uniform(-.3, .3);
    }
    if (image % 10 == 3) s.model->geom_rgba[4 * 6 + 2] = static_cast<float>(rng.uniform(0, 1));
    s.update();
    const View& view =
        s.view(builder, {side, -5, 2.5}, {1, 0, 0}, {0, std::sin(.4), std::cos(.4)}, grid);
    tiles.compare(view);
    ImageTargets some = targets_of(kept);
    some.changed_tiles = tiles.changed();
    some.receivers = tiles.receivers();
    s.draw(view, some);
    tiles.keep(view);
    s.draw(view, targets_of(whole));
    ASSERT_EQ(kept.rgb, whole.rgb) << image;
    ASSERT_EQ(kept.depth, whole.depth) << image;
    ASSERT_EQ(kept.ids, whole.ids) << image;
    ASSERT_EQ(kept.normals, whole.normals) << image;
    const int number = ((150 + 15) / 16) * ((130 + 15) / 16);
    const int marked = static_cast<int>(std::count(tiles.changed(), tiles.changed() + number, 1));
    if (image == 0) {
      EXPECT_EQ(marked, number);
    }
    if (image % 10 == 5) {
      EXPECT_EQ(marked, 0);
    }
    if (image % 10 == 9) {
      EXPECT_EQ(marked, number);
    }
    changed += marked;
    all += number;
  }
  EXPECT_LT(changed, .8 * all);
}

constexpr char kSun[] = "<light type='directional' dir='.3 .2 -1' castshadow='true'/>";
constexpr char kSpot[] =
    "<light pos='1 -1 4' dir='-.2 .2 -1' cutoff='40' castshadow='true'/>"
    "<light pos='-3 -3 3' dir='1 1 -1' castshadow='false'/>";
constexpr char kBulb[] = "<light pos='.5 0 1.2' dir='0 0 -1' cutoff='180' castshadow='true'/>";

INSTANTIATE_TEST_SUITE_P(Scenes, ChangedTilesOf,
                         ::testing::Values(Case{kSun, 0, true, false}, Case{kSun, 0, true, true},
                                           Case{kSpot, .3, true, true}, Case{kBulb, 0, true, false},
                                           Case{kSun, .3, false, true},
                                           Case{kSpot, 0, false, false}));

// Near the window of a thin geom, pixels are sampled more than once, although the geom may be
// elsewhere in the window: |\|. A stick is moved into the image of a checkerboard and out of it.
class ThinGeoms : public ::testing::TestWithParam<std::pair<double, double>> {};

TEST_P(ThinGeoms, AreSampledInTheirWindows) {
  const auto [alpha, reflectance] = GetParam();
  TestRenderer s(fmt::format(
      "<asset><texture name='checks' type='2d' builtin='checker' rgb1='0 0 0' rgb2='1 1 1' "
      "width='256' height='256'/><material name='checks' texture='checks' texrepeat='12 12' "
      "reflectance='{}'/></asset><worldbody><geom type='plane' size='32 32 1' material='checks'/>"
      "<body><freejoint/><geom type='box' size='15 .001 .001' mass='1' rgba='1 0 0 {}'/></body>"
      "</worldbody>",
      reflectance, alpha));
  s.options.reflections = true;
  s.update();
  ViewBuilder builder(s.model.get(), *s.assets, s.options);
  const PixelGrid grid = grid_from_fovy(32, 32, 32, true);  // a pixel is 1 m wide
  Picture kept(32, 32), whole(32, 32);
  ChangedTiles tiles;
  const auto draw = [&](Picture& picture, const View& view, bool all) {
    ImageTargets targets;
    targets.rgb = picture.rgb.data();
    targets.samples = 4;
    targets.multisampled = true;
    if (!all) {
      targets.changed_tiles = tiles.changed();
      targets.receivers = tiles.receivers();
    }
    s.draw(view, targets);
  };
  int different = 0;
  // `angle`: from the x axis, rad.
  const auto expect_equal = [&](double angle, double x, double y) {
    double* qpos = s.data->qpos;
    for (double away : {0, 100}) {
      qpos[0] = x + away;
      qpos[1] = y;
      qpos[2] = 2;
      qpos[3] = std::cos(angle / 2);
      qpos[6] = std::sin(angle / 2);
      s.update();
      const View& view = s.view(builder, {0, 0, 50}, {1, 0, 0}, {0, 1, 0}, grid);
      tiles.compare(view);
      draw(kept, view, false);
      tiles.keep(view);
      const auto before = whole.rgb;
      draw(whole, view, true);
      different += before != whole.rgb;
      ASSERT_EQ(kept.rgb, whole.rgb) << angle << " " << x << " " << y << " " << away;
    }
  };
  for (double angle : {.08, -.08})
    for (double offset = -1.5; offset < 1.5; offset += .1) {
      expect_equal(angle, 14, offset);
      expect_equal(M_PI / 2 + angle, offset, 14);
    }
  // At the border of a tile, within the error of single precision.
  for (double offset = .001; offset < .00102; offset += 2e-7) expect_equal(M_PI / 2, offset, 0);
  EXPECT_GT(different, 200);
}

INSTANTIATE_TEST_SUITE_P(Sticks, ThinGeoms,
                         ::testing::Values(std::pair(.5, 0.), std::pair(1., .3)));

}  // namespace
}  // namespace mjsense::render
