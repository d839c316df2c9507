// SPDX-License-Identifier: Apache-2.0
// Height fields with difficult surfaces: flat tops in the plane in which rays enter the field,
// steps, heights of few distinct values, and rays through grid points, edges and corners.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/kernels.h"
#include "mjsense/rays/testing/reference.h"
#include "mjsense/rays/testing/scene.h"

namespace mjsense::rays {
namespace {

using testing::disagreement;
using testing::ray_count;

//  kPlateaus  --__/--\_   noise, clipped at both ends
//  kSteps     __|--|_     0 or 1
//  kEightBit  -_=-_=      noise with few distinct values of 255
//  kBowl      --\__/--    the rim is clipped
//  kPyramid   __/--\__    a slope tile
//  kFlat      ______      only the base
enum Ground { kPlateaus, kSteps, kEightBit, kBowl, kPyramid, kFlat, kNumGrounds };

double height(Rng& rng, Ground ground, double x, double y) {  // x, y in -1..1
  switch (ground) {
    case kPlateaus:
      return std::clamp(rng.uniform(-0.5, 1.5), 0.0, 1.0);
    case kSteps:
      return rng.below(3) == 0 ? 0.0 : 1.0;
    case kEightBit:
      return std::floor(rng.uniform(0, 6)) * 51 / 255;
    case kBowl:
      return std::min(x * x + y * y, 0.6);
    case kPyramid:
      return std::min(1 - std::max(std::abs(x), std::abs(y)), 0.7);
    default:
      return 0.0;
  }
}

struct Ray {
  double o[3], d[3];
};

// A height field at a random pose, and rays in its frame.
class Field {
 public:
  Field(Rng& rng, Ground ground) : model_(xml(rng, ground)) {}

  const TestModel& model() const { return model_; }
  double half(int axis) const { return size()[axis]; }
  double top() const { return size()[2]; }

  // Random target of a ray, in the field's frame.
  std::array<double, 3> point(Rng& rng) const {
    const mjModel* m = model_.model;
    std::array<double, 3> p{};
    const int n[2] = {m->hfield_ncol[0], m->hfield_nrow[0]};
    for (int k = 0; k < 2; ++k) {
      // Per axis either within a cell or on a grid line. Two grid lines are a grid point, possibly
      // at the border or at a corner of the field.
      const double at = rng.below(2) ? rng.uniform(0, n[k] - 1) : rng.below(n[k]);
      p[k] = half(k) * (2 * at / (n[k] - 1) - 1);
    }
    p[2] = rng.below(3) == 0 ? rng.uniform(0, top()) : top();
    return p;
  }
  void to_world(const double local[3], double world[3]) const {
    mju_mulMatVec3(world, model_.data->geom_xmat, local);
    for (int k = 0; k < 3; ++k) world[k] += model_.data->geom_xpos[k];
  }
  // Whether the point is outside the bounding box of the field and its base.
  bool outside(const double world[3]) const {
    double from[3], p[3];
    mju_sub3(from, world, model_.data->geom_xpos);
    mju_mulMatTVec3(p, model_.data->geom_xmat, from);
    const double clear = 1e-3;
    return std::abs(p[0]) > half(0) + clear || std::abs(p[1]) > half(1) + clear ||
           p[2] > top() + clear || p[2] < -size()[3] - clear;
  }
  // For failure messages: the ray in the field's frame, and the field's size.
  std::string local(const Ray& ray) const {
    double from[3], o[3], d[3];
    mju_sub3(from, ray.o, model_.data->geom_xpos);
    mju_mulMatTVec3(o, model_.data->geom_xmat, from);
    mju_mulMatTVec3(d, model_.data->geom_xmat, ray.d);
    return testing::vec({o[0], o[1], o[2]}) + "along " + testing::vec({d[0], d[1], d[2]}) +
           "of a field " + testing::vec({half(0), half(1), top()});
  }
  void turn(const double local[3], double world[3]) const {
    mju_mulMatVec3(world, model_.data->geom_xmat, local);
  }

 private:
  const mjtNum* size() const { return model_.model->hfield_size; }

  static std::string xml(Rng& rng, Ground ground) {
    const int rows = 2 + rng.below(24), cols = 2 + rng.below(24);
    std::string heights;
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < cols; ++c)
        heights +=
            testing::vec({height(rng, ground, 2.0 * c / (cols - 1) - 1, 2.0 * r / (rows - 1) - 1)});
    const double far = rng.below(3) == 0 ? 0 : rng.below(2) ? 3 : 40;
    const double tilt = rng.below(2) ? 0 : rng.below(2) ? 10 : 180;
    const auto within = [&](double x) { return x > 0 ? rng.uniform(-x, x) : 0.0; };
    return "<mujoco><asset><hfield name='ground' nrow='" + std::to_string(rows) + "' ncol='" +
           std::to_string(cols) + "' elevation='" + heights + "' size='" +
           testing::vec({rng.uniform(0.3, 5), rng.uniform(0.3, 5), rng.uniform(0.02, 2),
                         rng.uniform(0.01, 1)}) +
           "'/></asset><worldbody><geom type='hfield' hfield='ground' pos='" +
           testing::vec({within(far), within(far), within(far)}) + "' euler='" +
           testing::vec({within(tilt), within(tilt), tilt > 0 ? within(180) : 0.0}) +
           "'/></worldbody></mujoco>";
  }

  TestModel model_;
};

Ray random_ray(Rng& rng, const Field& field) {
  const auto target = field.point(rng);
  double d[3] = {0, 0, -1};
  const int kind = rng.below(6);
  if (kind >= 2) testing::random_direction(rng, d);
  if (kind >= 2 && kind < 5) d[2] = -std::abs(d[2]);
  if (kind == 1) d[2] = 1;             // from below the surface
  if (kind == 4) d[2] *= 0.01;         // grazing
  if (kind == 3) d[rng.below(2)] = 0;  // along the grid
  mju_normalize3(d);
  // Starts far before the target, close before it, or behind it, i.e. above the surface or inside
  // the field.
  const double away = rng.below(8) == 0   ? 1e-4
                      : rng.below(8) == 0 ? rng.uniform(-1, 0)
                                          : rng.uniform(0, 10);
  double o[3];
  for (int k = 0; k < 3; ++k) o[k] = target[k] - away * d[k];
  Ray ray;
  field.to_world(o, ray.o);
  field.turn(d, ray.d);
  return ray;
}

class HeightFields : public testing::EveryKernel {};
INSTANTIATE_TEST_SUITE_P(Isas, HeightFields, testing::every_isa(), testing::isa_of);

// For the long run: MJSENSE_TEST_RAYS=10000000.
TEST_P(HeightFields, NoRayPassesThrough) {
  Rng rng(11, 0, 0, 0);
  const long total = ray_count(120000), per_field = 400;
  long wrong = 0, hits = 0;
  for (long i = 0; i < total; i += per_field) {
    const auto ground = static_cast<Ground>(i / per_field % kNumGrounds);
    const Field field(rng, ground);
    RayScene scene(field.model().model, 1, isa());
    scene.update(field.model().world());
    for (long k = 0; k < per_field; ++k) {
      const Ray ray = random_ray(rng, field);
      const Hit hit = scene.trace(0, {}, ray.o, ray.d);
      hits += hit.geom >= 0;
      const std::string text = disagreement(field.model(), ray.o, ray.d, hit);
      if (text.empty()) continue;
      ADD_FAILURE() << "ground " << ground << " ray " << k << " of field " << i / per_field << ": "
                    << text << "; in its frame from " << field.local(ray);
      ASSERT_LT(++wrong, 5);
    }
  }
  EXPECT_GT(hits, total / 2) << "too few hits to mean anything";
}

//   |\  |          A ray in the plane of the field's border: it starts below or above the surface
//   | \_|__        and runs up, down or along it. Rounding decides on which side of the border it
//  -|-->|          is, but it must not leave the field where there is no surface.
//   |___|
TEST_P(HeightFields, NoRayInTheBorderPlanePassesThrough) {
  Rng rng(13, 0, 0, 0);
  int wrong = 0, hits = 0, rays = 0;
  for (int i = 0; i < 180; ++i) {
    const Field field(rng, static_cast<Ground>(i % kNumGrounds));
    RayScene scene(field.model().model, 1, isa());
    scene.update(field.model().world());
    for (int k = 0; k < 40; ++k) {
      const int across = rng.below(2);
      double p[3], d[3], o[3];
      for (int j = 0; j < 2; ++j) p[j] = rng.uniform(-field.half(j), field.half(j));
      p[across] = rng.below(2) ? field.half(across) : -field.half(across);
      p[2] = rng.uniform(0, field.top());
      testing::random_direction(rng, d);
      if (rng.below(2)) d[0] = d[1] = 0;
      d[across] = 0;
      mju_normalize3(d);
      // The direction deviates from the plane by 0, or by the residue of sines and cosines that
      // should cancel.
      if (rng.below(2)) d[across] = (rng.below(2) ? 1 : -1) * std::pow(10, -rng.uniform(12, 19));
      const double away = rng.below(2) ? 0 : rng.uniform(0, 3);
      for (int j = 0; j < 3; ++j) o[j] = p[j] - away * d[j];
      Ray ray;
      field.to_world(o, ray.o);
      field.turn(d, ray.d);
      const Hit hit = scene.trace(0, {}, ray.o, ray.d);
      ++rays;
      hits += hit.geom >= 0;
      const std::string text = disagreement(field.model(), ray.o, ray.d, hit);
      if (text.empty()) continue;
      ADD_FAILURE() << "ray " << k << " of field " << i << ": " << text << "; in its frame from "
                    << field.local(ray);
      ASSERT_LT(++wrong, 5);
    }
  }
  EXPECT_GT(hits, rays / 3);
}

// A hit of a ray from outside is always on a front face.
TEST_P(HeightFields, CullingAgreesWithTrace) {
  Rng rng(12, 0, 0, 0);
  int lanes = 0, hits = 0;
  for (int i = 0; i < 600; ++i) {
    const Field field(rng, static_cast<Ground>(i % kNumGrounds));
    RayScene scene(field.model().model, 1, isa());
    RayScratch scratch(scene.num_objects());
    scene.update(field.model().world());
    for (int packet = 0; packet < 8; ++packet) {
      RayPacket rays{};
      mju_copy3(rays.origin, field.model().data->geom_xpos);
      for (int lane = 0; lane < kPacket; ++lane) {
        const Ray ray = random_ray(rng, field);
        for (int k = 0; k < 3; ++k) {
          rays.o[k][lane] = static_cast<float>(ray.o[k] - rays.origin[k]);
          rays.d[k][lane] = static_cast<float>(ray.d[k]);
        }
        rays.tmax[lane] = field.outside(ray.o) ? static_cast<float>(rng.uniform(0, 20)) : -1;
      }
      HitPacket all, culled;
      scene.trace(0, {}, rays, all, scratch);
      scene.trace(0, {.backfaces = RayFilter::Backfaces::kCull}, rays, culled, scratch);
      for (int lane = 0; lane < kPacket; ++lane) {
        if (rays.tmax[lane] < 0) continue;
        ++lanes;
        hits += all.geom[lane] >= 0;
        ASSERT_EQ(all.t[lane], culled.t[lane]) << "field " << i << " lane " << lane;
      }
    }
  }
  EXPECT_GT(lanes, 30000);
  EXPECT_GT(hits, lanes / 3);
}

//    /\    2 size[2]      The compiler scales heights to 0..1, but programs write others, such as
//   /  \-- size[2]        metres, into hfield_data.
TEST_P(HeightFields, HeightsAboveOneAreHit) {
  const TestModel m(
      "<mujoco><asset><hfield name='h' nrow='3' ncol='3' size='1 1 .7 .1' elevation='0 0 0  0 1 0 "
      " 0 0 0'/></asset><worldbody><geom type='hfield' hfield='h' pos='.1 .2 .3'/></worldbody>"
      "</mujoco>");
  m.model->hfield_data[4] = 2;
  RayScene scene(m.model, 1, isa());
  scene.update(m.world());
  const double above[3] = {0.1, 0.2, 3}, down[3] = {0, 0, -1};
  EXPECT_NEAR(scene.trace(0, {}, above, down).t, 3 - (0.3 + 1.4), 1e-6);
  // At three quarters of the height, above size[2].
  const double beside[3] = {-2.9, 0.2, 0.3 + 1.05}, forward[3] = {1, 0, 0};
  EXPECT_NEAR(scene.trace(0, {}, beside, forward).t, 3 - 0.25, 1e-5);
}

// A ray that leaves the ground hits the surface from below; the normal points up.
TEST_P(HeightFields, RayFromInsideHitsAFlatTop) {
  const TestModel m(
      "<mujoco><asset><hfield name='h' nrow='3' ncol='3' size='1 1 .7 .1' elevation='1 1 1  1 1 1 "
      " 1 1 0'/></asset><worldbody><geom type='hfield' hfield='h' pos='.1 .2 .3'/></worldbody>"
      "</mujoco>");
  RayScene scene(m.model, 1, isa());
  scene.update(m.world());
  for (double x : {-0.7, -0.5, 0.1, 0.3}) {
    const double o[3] = {x, 0.05, 0.4}, up[3] = {0, 0, 1};
    const Hit hit = scene.trace(0, {}, o, up);
    EXPECT_NEAR(hit.t, 0.6, 1e-6);
    EXPECT_EQ(hit.normal, (std::array<float, 3>{0, 0, 1}));
    EXPECT_GE(hit.prim, 0);
    EXPECT_LT(scene.trace(0, {.backfaces = RayFilter::Backfaces::kCull}, o, up).geom, 0);
  }
}

}  // namespace
}  // namespace mjsense::rays
