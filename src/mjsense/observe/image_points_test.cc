// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/image_points.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/observe/testing/world.h"

namespace mjsense::observe {
namespace {

// Body a has geoms 0 and 1, body b has geom 2, which is invisible.
constexpr char kScene[] = R"(
<mujoco><worldbody>
  <body name="a"><geom size="1"/><body name="a2"><geom size="1"/></body></body>
  <body name="b"><geom size="1" group="3"/></body>
</worldbody></mujoco>)";

// A camera whose segmentation the test paints.
class Painted : public Sensor {
 public:
  Painted(int width, int height) : Sensor("camera"), width_(width), height_(height) {}
  std::string_view kind() const override { return "painted"; }
  void initialize(const SensorInit& init) override {
    SensorSpec spec;
    spec.dtype = DType::kInt32;
    spec.shape = {height_, width_, 2};
    auto all = add_field("segmentation", spec, init.num_worlds).data.all<std::int32_t>();
    std::ranges::fill(all, -1);
  }
  void compute(const World&) override {}
  void paint(int geom, int left, int top, int width, int height, int world = 0) {
    auto row = fields()[0].data.row<std::int32_t>(world);
    for (int y = top; y < top + height; ++y) {
      for (int x = left; x < left + width; ++x) {
        row[2 * (y * width_ + x)] = geom;
        row[2 * (y * width_ + x) + 1] = mjOBJ_GEOM;
      }
    }
  }

 private:
  int width_, height_;
};

struct Fixture {
  explicit Fixture(const std::string& key = "pickup_obj", const std::string& body = "a",
                   bool erode = true)
      : world(kScene),
        camera(100, 50),
        points("object_image_points", {{key, BodyRef(body), erode}}, {{"camera", &camera}}) {
    camera.initialize(world.init(2));
    points.initialize(world.init(2));
    prefix = key + "/camera/";
  }
  int count(int w = 0) { return values<std::int32_t>(points, prefix + "num_points", w)[0]; }
  std::vector<float> xy(int w = 0) { return values<float>(points, prefix + "points", w); }

  TestWorld world;
  Painted camera;
  ImagePointsSensor points;
  std::string prefix;
};

TEST(ImagePoints, InvisibleObjectsGiveNaN) {
  Fixture f;
  f.points.compute(f.world.world());
  EXPECT_EQ(f.count(), 0);
  for (float x : f.xy()) EXPECT_TRUE(std::isnan(x));
}

// Published example: a 6 x 7 mask leaves 2 x 3 = 6 points after two erosions, row by row.
TEST(ImagePoints, ErodesTwiceAndListsRowByRow) {
  Fixture f;
  f.camera.paint(1, 10, 20, 6, 7);  // geom 1 belongs to a2, which belongs to a
  f.points.compute(f.world.world());
  EXPECT_EQ(f.count(), 6);
  const auto xy = f.xy();
  const float expected[] = {.12f, .44f, .13f, .44f, .12f, .46f, .13f, .46f, .12f, .48f, .13f, .48f};
  for (int i = 0; i < 12; ++i) EXPECT_FLOAT_EQ(xy[i], expected[i]) << i;
  for (int i = 12; i < 20; ++i) EXPECT_TRUE(std::isnan(xy[i]));
}

TEST(ImagePoints, ObjectsRemovedByErosionKeepAllPixels) {
  Fixture f;
  f.camera.paint(0, 10, 20, 5, 2);
  f.points.compute(f.world.world());
  EXPECT_EQ(f.count(), 10);
  EXPECT_FLOAT_EQ(f.xy()[0], .10f);
  EXPECT_FLOAT_EQ(f.xy()[1], .40f);
  EXPECT_FLOAT_EQ(f.xy()[18], .14f);
}

TEST(ImagePoints, ThinObjectsAreNotEroded) {
  Fixture f("handle", "a", false);
  f.camera.paint(0, 10, 20, 3, 3);
  f.points.compute(f.world.world());
  EXPECT_EQ(f.count(), 9);
}

TEST(ImagePoints, InvisibleGroupsDoNotCount) {
  Fixture f("pickup_obj", "b");
  f.camera.paint(2, 10, 20, 20, 20);
  f.points.compute(f.world.world());
  EXPECT_EQ(f.count(), 0);
}

TEST(ImagePoints, DrawsTenDifferentPixelsByKey) {
  Fixture f;
  f.camera.paint(0, 10, 10, 40, 30);
  f.points.compute(f.world.world());
  const auto first = f.xy();
  std::set<std::pair<float, float>> different;
  for (int i = 0; i < 10; ++i) {
    different.insert({first[2 * i], first[2 * i + 1]});
    EXPECT_GE(first[2 * i], .12f - 1e-6f);
    EXPECT_LE(first[2 * i], .47f + 1e-6f);
    EXPECT_GE(first[2 * i + 1], .24f - 1e-6f);
    EXPECT_LE(first[2 * i + 1], .74f + 1e-6f);
  }
  EXPECT_EQ(different.size(), 10u);
  f.points.compute(f.world.world());
  EXPECT_EQ(f.xy(), first);
  World later = f.world.world();
  later.tick = 33;
  f.points.compute(later);
  EXPECT_NE(f.xy(), first);
}

TEST(ImagePoints, OutsideOfTheImageIsBackground) {
  Fixture f;
  f.camera.paint(0, 0, 0, 100, 50);
  f.points.compute(f.world.world());
  for (int i = 0; i < 10; ++i) {
    EXPECT_GE(f.xy()[2 * i], .02f - 1e-6f);
    EXPECT_LE(f.xy()[2 * i], .97f + 1e-6f);
  }
}

// In random images every point is in the mask that follows from the definition, computed pixel by
// pixel.
TEST(ImagePoints, PointsAreInTheMaskOfTheDefinition) {
  constexpr int kWidth = 100, kHeight = 50;
  Rng rng(1, 0, 0, 0);
  for (int picture = 0; picture < 200; ++picture) {
    Fixture f;
    const int blobs = 1 + static_cast<int>(rng.below(6));
    for (int k = 0; k < blobs; ++k) {
      const int x = static_cast<int>(rng.below(kWidth)), y = static_cast<int>(rng.below(kHeight));
      const int w = static_cast<int>(rng.below(kWidth - x)),
                h = static_cast<int>(rng.below(kHeight - y));
      f.camera.paint(k % 3, x, y, std::min(w, 25), std::min(h, 12));
    }
    using Mask = std::vector<char>;
    const auto segments = f.camera.fields()[0].data.row<std::int32_t>(0);
    Mask all(kWidth * kHeight);
    for (int i = 0; i < kWidth * kHeight; ++i)
      all[i] = segments[2 * i] == 0 || segments[2 * i] == 1;
    const auto erode = [&](const Mask& in) {
      Mask out(in.size());
      const auto at = [&](int x, int y) {
        return x >= 0 && y >= 0 && x < kWidth && y < kHeight && in[y * kWidth + x];
      };
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          out[y * kWidth + x] =
              at(x, y) && at(x - 1, y) && at(x + 1, y) && at(x, y - 1) && at(x, y + 1);
        }
      }
      return out;
    };
    Mask expected = erode(erode(all));
    if (std::ranges::count(expected, 1) == 0) expected = all;
    f.points.compute(f.world.world());
    ASSERT_EQ(f.count(), std::min<std::ptrdiff_t>(10, std::ranges::count(expected, 1)));
    for (int i = 0; i < f.count(); ++i) {
      const int x = static_cast<int>(std::lround(f.xy()[2 * i] * kWidth));
      const int y = static_cast<int>(std::lround(f.xy()[2 * i + 1] * kHeight));
      EXPECT_TRUE(expected[y * kWidth + x]) << "picture " << picture << " pixel " << x << " " << y;
    }
  }
}

// All objects are processed together, each within its bounding box. The points of an object must be
// the same as without other objects.
TEST(ImagePoints, PointsDoNotDependOnOtherObjects) {
  Rng rng(2, 0, 0, 0);
  TestWorld world(kScene);
  for (int picture = 0; picture < 100; ++picture) {
    Painted camera(37, 23);  // not multiples of 8, the number of pixels compared at a time
    camera.initialize(world.init(1));
    for (int k = 0; k < 5; ++k) {
      const int x = static_cast<int>(rng.below(37)), y = static_cast<int>(rng.below(23));
      camera.paint(static_cast<int>(rng.below(2)), x, y, std::min(37 - x, 9), std::min(23 - y, 9));
    }
    const ImagePointsSensor::Object whole{"whole", BodyRef("a")}, part{"part", BodyRef("a2")};
    ImagePointsSensor together("points", {whole, part}, {{"camera", &camera}});
    together.initialize(world.init(1));
    together.compute(world.world());
    for (const auto& object : {whole, part}) {
      ImagePointsSensor alone("points", {object}, {{"camera", &camera}});
      alone.initialize(world.init(1));
      alone.compute(world.world());
      const std::string prefix = object.key + "/camera/";
      const int n = values<std::int32_t>(alone, prefix + "num_points", 0)[0];
      EXPECT_EQ(values<std::int32_t>(together, prefix + "num_points", 0)[0], n);
      const auto a = values<float>(alone, prefix + "points", 0);
      const auto b = values<float>(together, prefix + "points", 0);
      for (int i = 0; i < 2 * n; ++i) EXPECT_EQ(a[i], b[i]) << picture;
    }
  }
}

TEST(ImagePoints, RefusesAnInvalidSegmentation) {
  TestWorld w(kScene);
  class Wrong : public Sensor {
   public:
    Wrong() : Sensor("camera") {}
    std::string_view kind() const override { return "wrong"; }
    void initialize(const SensorInit& init) override {
      SensorSpec spec;
      spec.shape = {4, 4};
      add_field("segmentation", spec, init.num_worlds);
    }
    void compute(const World&) override {}
  } wrong;
  wrong.initialize(w.init());
  ImagePointsSensor points("object_image_points", {{"a", "a"}}, {{"camera", &wrong}});
  EXPECT_THROW(points.initialize(w.init()), ValueError);
}

}  // namespace
}  // namespace mjsense::observe
