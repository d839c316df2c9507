// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/pose.h"

#include <gtest/gtest.h>

#include "mjsense/core/rng.h"

namespace mjsense {
namespace {

Vec3 random_vector(Rng& rng, double scale) {
  return {scale * rng.normal(), scale * rng.normal(), scale * rng.normal()};
}

TEST(Pose, LogIsTheInverseOfExp) {
  Rng rng(3, 0, 0, 0);
  for (int i = 0; i < 1000; ++i) {
    Vec3 w = random_vector(rng, 1.0);
    // Rotations from zero to just below half a turn.
    w = (3.14 * rng.uniform() / norm(w)) * w;
    if (i % 10 == 0) w = 1e-7 * w;
    const Twist twist{random_vector(rng, 0.5), w};
    const Twist back = log6(exp6(twist));
    // Below 1e-6 rad the linear part is the translation itself; its error is at most half the angle
    // times its length.
    EXPECT_LT(norm(back.v - twist.v), 1e-6) << i;
    EXPECT_LT(norm(back.w - twist.w), 1e-9) << i;
  }
}

TEST(Pose, ScrewAboutAnOffsetAxis) {
  // A quarter turn about the z axis through (1, 0, 0) moves the origin to (1, -1, 0).
  const double a = M_PI / 2;
  const Twist twist{{0, -a, 0}, {0, 0, a}};
  const Pose pose = exp6(twist);
  EXPECT_LT(norm(pose.p - Vec3{1, -1, 0}), 1e-12);
  EXPECT_NEAR(angle_between({}, pose.q), a, 1e-12);
}

TEST(Pose, MatrixToQuaternion) {
  Rng rng(4, 0, 0, 0);
  for (int i = 0; i < 1000; ++i) {
    const Quat q =
        normalized(Quat{rng.normal(), rng.normal(), rng.normal(), i % 3 == 0 ? 0.0 : rng.normal()});
    const Quat back =
        quat_from_columns(rotate(q, {1, 0, 0}), rotate(q, {0, 1, 0}), rotate(q, {0, 0, 1}));
    EXPECT_LT(angle_between(q, back), 1e-7);
  }
}

TEST(Pose, GroupLaws) {
  Rng rng(5, 0, 0, 0);
  for (int i = 0; i < 100; ++i) {
    const Pose a{random_vector(rng, 1), exp3(random_vector(rng, 1))},
        b{random_vector(rng, 1), exp3(random_vector(rng, 1))};
    const Vec3 p = random_vector(rng, 1);
    EXPECT_LT(norm((a * b) * p - a * (b * p)), 1e-12);
    EXPECT_LT(norm((inverse(a) * a) * p - p), 1e-12);
  }
}

}  // namespace
}  // namespace mjsense
