// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/object_shape.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/test_model.h"

namespace mjsense::tasks::episode {
namespace {

ModelPtr compile(const std::string& geoms) {
  return compile_mjcf("<mujoco><worldbody><body><freejoint/>" + geoms +
                      "</body></worldbody></mujoco>");
}

// Maximum distance of a point from the surface; `distance` returns the distance of one point.
template <class F>
double worst(const ObjectShape& shape, F distance) {
  double maximum = 0;
  for (Vec3 p : shape.points) maximum = std::max(maximum, std::abs(distance(p)));
  return maximum;
}

TEST(ObjectShape, PointsAreOnTheSurfaces) {
  const auto sphere = object_shape(compile("<geom size='.03' pos='0 0 .1'/>").get(), 1);
  EXPECT_LT(worst(sphere, [](Vec3 p) { return norm(p - Vec3{0, 0, 0.1}) - 0.03; }), 1e-9);
  EXPECT_NEAR(sphere.low, 0.07, 1e-9);
  EXPECT_NEAR(sphere.high, 0.13, 1e-9);
  EXPECT_NEAR(sphere.radius, 0.03, 1e-6);

  const auto capsule = object_shape(compile("<geom type='capsule' size='.02 .05'/>").get(), 1);
  EXPECT_LT(worst(capsule,
                  [](Vec3 p) {
                    const double z = std::max(0.0, std::abs(p.z) - 0.05);
                    return std::hypot(p.x, p.y, z) - 0.02;
                  }),
            1e-9);
  EXPECT_NEAR(capsule.high, 0.07, 1e-9);

  const auto cylinder = object_shape(compile("<geom type='cylinder' size='.02 .05'/>").get(), 1);
  EXPECT_LT(worst(cylinder,
                  [](Vec3 p) {
                    return std::min(std::abs(std::hypot(p.x, p.y) - 0.02),
                                    std::abs(std::abs(p.z) - 0.05));
                  }),
            1e-9);

  const auto box =
      object_shape(compile("<geom type='box' size='.01 .02 .03' euler='0 0 90'/>").get(), 1);
  EXPECT_LT(
      worst(
          box,
          [](Vec3 p) {
            return std::max({std::abs(p.x) / 0.02, std::abs(p.y) / 0.01, std::abs(p.z) / 0.03}) - 1;
          }),
      1e-9);
  EXPECT_NEAR(box.radius, std::hypot(0.01, 0.02), 1e-9);
}

TEST(ObjectShape, DescendantsAreIncludedAtTheirPoses) {
  const auto model = compile(
      "<geom size='.01'/><body pos='0 0 .1' euler='90 0 0'><body pos='0 .2 0'><geom "
      "size='.02'/></body></body>");
  const auto shape = object_shape(model.get(), 1);  // y of the tilted body is z of the object
  EXPECT_LT(worst(shape,
                  [](Vec3 p) {
                    return std::min(norm(p) - 0.01, norm(p - Vec3{0, 0, 0.3}) - 0.02);
                  }),
            1e-9);
  EXPECT_NEAR(shape.high, 0.32, 1e-9);
}

TEST(ObjectShape, VisualGeomsAreIgnored) {
  const auto model = compile("<geom size='.01'/><geom size='.5' contype='0' conaffinity='0'/>");
  EXPECT_NEAR(object_shape(model.get(), 1).reach, 0.01, 1e-9);
  EXPECT_THROW(object_shape(compile("<geom size='.1' contype='0' conaffinity='0'/>").get(), 1),
               ValueError);
}

}  // namespace
}  // namespace mjsense::tasks::episode
