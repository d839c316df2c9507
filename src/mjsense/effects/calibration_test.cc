// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/calibration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/effects/testing/bench.h"

namespace mjsense::effects {
namespace {

using ::testing::ElementsAre;

TEST(Calibration, ClipScaleQuantize) {
  Bench bench(
      {std::make_shared<Clip>(Clip::saturation(2)), std::make_shared<Scale>(PerComponent{10}),
       std::make_shared<Quantize>(PerComponent{4})},
      4);
  EXPECT_THAT(bench.feed_row({-5, 0.3f, 0.5f, 1.1f}, 0), ElementsAre(-20, 4, 4, 12));
}

TEST(Calibration, MisalignmentRotatesAndScales) {
  Misalignment m;
  m.angle = {0, 0, std::numbers::pi / 2};
  m.scale_error = {0.1, 0, 0};
  Bench bench(one(m), 6);
  const std::vector<float> v = bench.feed_row({1, 0, 0, 0, 1, 2}, 0);
  EXPECT_NEAR(v[0], 0, 1e-6);
  EXPECT_NEAR(v[1], 1, 1e-6);
  EXPECT_NEAR(v[3], -1.1, 1e-6);
  EXPECT_NEAR(v[5], 2, 1e-6);
}

TEST(Calibration, NanPolicies) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Bench sanitize(one(NanPolicy(NanPolicy::Action::kSanitize)), 2);
  EXPECT_THAT(sanitize.feed_row({nan, 1}, 0), ElementsAre(0, 1));
  Bench error(one(NanPolicy(NanPolicy::Action::kError)), 2);
  EXPECT_EQ(error_of<RuntimeError>([&] {
              error.feed_row({1, nan}, 0);
            }),
            "sensor 'test', effect 0 (nan_policy): 1 of 2 values are not finite in world 0 "
            "(first: index 1)");
}

TEST(Calibration, InfinitiesAreHandledLikeNan) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  Bench sanitize(one(NanPolicy(NanPolicy::Action::kSanitize)), 4);
  EXPECT_THAT(sanitize.feed_row({inf, 1, -inf, nan}, 0), ElementsAre(0, 1, 0, 0));
  Bench disabled(one(NanPolicy(NanPolicy::Action::kDisabled)), 2);
  EXPECT_THAT(disabled.feed_row({inf, -inf}, 0), ElementsAre(inf, -inf));
  for (const float bad : {inf, -inf}) {
    Bench error(one(NanPolicy(NanPolicy::Action::kError)), 3);
    EXPECT_THROW(error.feed_row({1, 2, bad}, 0), RuntimeError) << bad;
  }
  Bench warn(one(NanPolicy(NanPolicy::Action::kWarn)), 2);
  ::testing::internal::CaptureStderr();
  EXPECT_THAT(warn.feed_row({-inf, 2}, 0), ElementsAre(-inf, 2));  // warned about, but not changed
  warn.feed_row({-inf, 2}, 1);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "sensor 'test', effect 0 (nan_policy): 1 of 2 values are not finite in world 0\n");
}

// Scale errors apply to the axes of the device, after the rotation: M = diag(s) R.
TEST(Calibration, MisalignmentScalesTheDevicesAxes) {
  Misalignment m;
  m.scale_error = {0.1, 0.0, -0.2};
  m.angle = {0, 0, std::numbers::pi / 2};  // the body's x is measured on the device's y
  Bench bench(one(m), 3);
  const std::vector<float> x = bench.feed_row({1, 0, 0}, 0);
  EXPECT_NEAR(x[0], 0, 1e-6);
  EXPECT_NEAR(x[1], 1, 1e-6);
  const std::vector<float> y = bench.feed_row({0, 1, 0}, 0);
  EXPECT_NEAR(y[0], -1.1, 1e-6);
  EXPECT_NEAR(y[1], 0, 1e-6);
  const std::vector<float> z = bench.feed_row({0, 0, 1}, 0);
  EXPECT_NEAR(z[2], 0.8, 1e-6);
}

TEST(Calibration, ClipsAtBothEnds) {
  Bench both(one(Clip({-2}, {3})), 3);
  EXPECT_THAT(both.feed_row({-5, 0, 5}, 0), ElementsAre(-2, 0, 3));
  Bench saturated(one(Clip::saturation(4)), 2);
  EXPECT_THAT(saturated.feed_row({-9, 9}, 0), ElementsAre(-4, 4));
}

}  // namespace
}  // namespace mjsense::effects
