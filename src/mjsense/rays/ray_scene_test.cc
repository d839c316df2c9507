// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/ray_scene.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "mjsense/core/testing/allocations.h"
#include "mjsense/rays/testing/kernels.h"
#include "mjsense/rays/testing/reference.h"
#include "mjsense/rays/testing/scene.h"

namespace mjsense::rays {
namespace {

using testing::agree;
using testing::disagreement;
using testing::mujoco_ray;
using testing::ray_count;
using testing::Reference;

class RandomRays : public ::testing::TestWithParam<const char*> {};

TEST_P(RandomRays, AgreeWithMjRay) {
  Rng rng(7, 0, stream_of(GetParam()), 0);
  const long total = ray_count(20000);
  const int scenes = 6;
  long wrong = 0, wrong_geom = 0, wrong_normal = 0, hits = 0;
  for (int s = 0; s < scenes; ++s) {
    const std::string type = GetParam();
    const std::string xml = type == "all"
                                ? testing::random_scene(rng,
                                                        {"plane", "sphere", "capsule", "ellipsoid",
                                                         "cylinder", "box", "mesh", "hfield"},
                                                        40, 4)
                                : testing::random_scene(rng, {GetParam()}, 6, 1.5);
    const TestModel m(xml);
    // Use each of the CPU's instruction sets in turn.
    RayScene scene(m.model, 1, static_cast<Isa>(s % (static_cast<int>(cpu_isa()) + 1)));
    scene.update(m.world());
    for (long i = 0; i < total / scenes; ++i) {
      double o[3], d[3];
      for (double& x : o) x = rng.uniform(-5, 5);
      testing::random_direction(rng, d);
      if (rng.below(2)) testing::aim(rng, 1.5, o, d);
      if (rng.below(4) == 0) {  // along an axis
        const int axis = rng.below(3);
        for (int k = 0; k < 3; ++k) d[k] = k == axis ? (d[k] < 0 ? -1 : 1) : 0;
      }
      const Reference reference = mujoco_ray(m, o, d);
      const Hit hit = scene.trace(0, {}, o, d);
      hits += reference.t >= 0;
      if (const std::string text = disagreement(m, o, d, hit); !text.empty()) {
        ADD_FAILURE() << text;
        ASSERT_LT(++wrong, 5);
      }
      if (reference.t < 0 || !hit || std::abs(hit.t - reference.t) > 1e-5) continue;
      wrong_geom += hit.geom != reference.geom;
      double cosine = 0;
      for (int k = 0; k < 3; ++k) cosine += reference.normal[k] * hit.normal[k];
      wrong_normal += hit.geom == reference.geom && cosine < 0.999;
    }
  }
  EXPECT_GT(hits, total / 50) << "too few hits to mean anything";
  EXPECT_LE(wrong_geom, total / 10000);
  EXPECT_LE(wrong_normal, total / 5000);  // rays that hit an edge
}

INSTANTIATE_TEST_SUITE_P(Shapes, RandomRays,
                         ::testing::Values("plane", "sphere", "capsule", "ellipsoid", "cylinder",
                                           "box", "mesh", "hfield", "all"),
                         [](const auto& info) { return std::string(info.param); });

class Kernels : public testing::EveryKernel {};
INSTANTIATE_TEST_SUITE_P(Isas, Kernels, testing::every_isa(), testing::isa_of);

// A packet of rays from one origin into a cone around a random direction.
RayPacket random_packet(Rng& rng, double origin, double spread) {
  RayPacket rays;
  double axis[3];
  testing::random_direction(rng, axis);
  for (double& x : rays.origin) x = rng.uniform(-origin, origin);
  for (int i = 0; i < kPacket; ++i) {
    double d[3];
    testing::random_direction(rng, d);
    for (int k = 0; k < 3; ++k) d[k] = axis[k] + spread * d[k];
    mju_normalize3(d);
    for (int k = 0; k < 3; ++k) {
      rays.o[k][i] = static_cast<float>(rng.uniform(-0.1, 0.1));
      rays.d[k][i] = static_cast<float>(d[k]);
    }
    rays.tmax[i] = rng.below(8) == 0 ? -1.0f : static_cast<float>(rng.uniform(0, 12));
  }
  return rays;
}

TEST_P(Kernels, FocusedAndPlainTracesAreIdentical) {
  Rng rng(3, 0, 0, 0);
  const TestModel m(
      testing::random_scene(rng, {"plane", "sphere", "capsule", "box", "mesh", "hfield"}, 60, 4));
  RayScene scene(m.model, 1, isa());
  scene.update(m.world());
  RayScratch a(scene.num_objects()), b(scene.num_objects());
  for (int trial = 0; trial < 300; ++trial) {
    RayPacket packets[3] = {random_packet(rng, 5, trial % 3 * 0.3), random_packet(rng, 5, 0.1),
                            random_packet(rng, 5, 2)};
    for (RayPacket& p : packets) std::copy_n(packets[0].origin, 3, p.origin);
    scene.cull(0, {}, packets, a);
    for (const RayPacket& p : packets) {
      HitPacket x, y;
      scene.trace_culled(0, {}, p, x, a);
      scene.trace(0, {}, p, y, b);
      EXPECT_EQ(std::memcmp(x.t, y.t, sizeof x.t), 0);
      EXPECT_EQ(std::memcmp(x.geom, y.geom, sizeof x.geom), 0);
      EXPECT_EQ(std::memcmp(x.n, y.n, sizeof x.n), 0);
    }
  }
}

// Results must not depend on the CPU: every product and sum is rounded separately.
TEST_P(Kernels, RowsEqualTheHits) {
  Rng rng(31, 0, 0, 0);
  const TestModel m(testing::random_scene(rng, {"sphere", "capsule", "box", "mesh"}, 40, 4));
  for (int g = 0; g < m.model->ngeom; ++g) {
    for (int k = 0; k < 3; ++k)
      m.model->geom_rgba[4 * g + k] = static_cast<float>(rng.uniform(0, 1));
  }
  RayScene scene(m.model, 1, isa());
  scene.update(m.world());
  RayScratch scratch(scene.num_objects());
  const auto same = [](float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; };
  int before = 0, behind = 0, there = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    const RayPacket rays = random_packet(rng, 5, 1);
    LocalPacket local{};
    for (auto& row : local.d)
      for (float& x : row) x = static_cast<float>(rng.uniform(-1, 1));
    HitPacket found, hits;
    scene.trace(0, {}, rays, found, scratch);
    hits = found;
    const float nearest = 1.0f, farthest = 4.0f;
    RayOutputs rows;
    scene.rows(0, rays, nearest, farthest, true, hits, rows);
    LidarReturns back;
    scene.returns(0, local, rays, hits, back);
    for (int i = 0; i < kPacket; ++i) {
      const bool hit = found.geom[i] >= 0 && found.t[i] >= nearest;
      before += found.geom[i] >= 0 && !hit;
      behind += hit && found.t[i] > farthest;
      there += hit;
      EXPECT_EQ(hits.geom[i], hit ? found.geom[i] : -1);
      EXPECT_EQ(hits.t[i], std::min(found.t[i], farthest));
      EXPECT_EQ(rows.distance[i], hit ? hits.t[i] : -1.0f);
      EXPECT_EQ(rows.body[i], hit ? m.model->geom_bodyid[hits.geom[i]] : -1);
      EXPECT_EQ(rows.material[i], hit ? m.model->geom_matid[hits.geom[i]] : -1);
      const volatile float t = hit ? hits.t[i] : 0.0f;
      float cosine = 0;
      for (int k = 0; k < 3; ++k) {
        const volatile float offset = t * rays.d[k][i], from = rays.o[k][i] + offset;
        EXPECT_TRUE(same(rows.pos[3 * i + k], static_cast<float>(rays.origin[k] + from)));
        EXPECT_TRUE(same(rows.normal[3 * i + k], hit ? found.n[k][i] : 0.0f));
        EXPECT_TRUE(same(back.point[3 * i + k], t * local.d[k][i]));
        const volatile float part = rays.d[k][i] * found.n[k][i];
        cosine = k == 0 ? part : cosine + part;
      }
      float seen = 0;
      if (hit) {
        const float* c = scene.world(0).rgba().data() + 4 * std::ptrdiff_t{found.geom[i]};
        seen = std::clamp((c[0] + c[1] + c[2]) / 3 * std::abs(cosine), 0.0f, 1.0f);
      }
      EXPECT_TRUE(same(back.intensity[i], seen));
    }
  }
  EXPECT_GT(before, 20);
  EXPECT_GT(behind, 20);
  EXPECT_GT(there, 500);
}

TEST_P(Kernels, PreciseFarFromTheWorldOrigin) {
  // Everything is 1000 m from the origin, seen from 10 m.
  Rng rng(5, 0, 0, 0);
  for (const char* type :
       {"plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "hfield"}) {
    const TestModel m(testing::random_scene(rng, {type}, 1, 0));
    for (int k = 0; k < 3; ++k) m.data->geom_xpos[k] += 1000 - 300 * k;
    RayScene scene(m.model, 1, isa());
    scene.update(m.world());
    double worst = 0;
    int hits = 0;
    for (int i = 0; i < 2000; ++i) {
      double o[3], d[3];
      testing::random_direction(rng, o);
      for (int k = 0; k < 3; ++k) o[k] *= 10;
      testing::aim(rng, 0.2, o, d);
      for (int k = 0; k < 3; ++k) o[k] += m.data->geom_xpos[k];
      const Reference reference = mujoco_ray(m, o, d);
      const Hit hit = scene.trace(0, {}, o, d);
      if (reference.t < 0 || !hit) continue;
      const double cosine = std::abs(mju_dot3(reference.normal, d));
      if (cosine < 0.2) continue;  // grazing: a small sideways error is a large error along the ray
      ++hits;
      worst = std::max(worst, std::abs(hit.t - reference.t));
    }
    EXPECT_GT(hits, 100) << type;
    EXPECT_LT(worst, 1e-5) << type;
  }
}

TEST_P(Kernels, GrazingRaysOverWideTerrain) {
  Rng rng(8, 0, 0, 0);
  std::string hills;
  for (int r = 0; r < 45; ++r) {
    for (int c = 0; c < 70; ++c)
      hills += testing::vec(
          {0.3 + 0.2 * std::sin(0.3 * r) * std::cos(0.2 * c) + (rng.below(40) == 0 ? 0.4 : 0.0)});
  }
  const TestModel m(
      "<mujoco><asset><hfield name='hills' nrow='45' ncol='70' size='14 9 2 .1' elevation='" +
      hills +
      "'/></asset><worldbody><geom type='hfield' hfield='hills' euler='3 -4 "
      "30'/></worldbody></mujoco>");
  RayScene scene(m.model, 1, isa());
  scene.update(m.world());
  int wrong = 0, hits = 0;
  for (int i = 0; i < 1500; ++i) {
    double o[3] = {rng.uniform(-16, 16), rng.uniform(-12, 12), rng.uniform(0, 2.5)};
    double d[3] = {rng.normal(), rng.normal(), rng.uniform(-0.3, 0.15)};
    mju_normalize3(d);
    const Hit hit = scene.trace(0, {}, o, d);
    hits += hit.geom >= 0;
    wrong += !agree(m, o, d, hit);
  }
  EXPECT_EQ(wrong, 0);
  EXPECT_GT(hits, 500);
}

constexpr char kLayers[] = R"(
<mujoco><asset><mesh name="cube" vertex="-1 -1 -1 1 -1 -1 1 1 -1 -1 1 -1 -1 -1 1 1 -1 1 1 1 1 -1 1 1"/>
  <material name="clear" rgba="1 1 1 0"/></asset><worldbody>
  <geom name="floor" type="plane" size="0 0 1" pos="0 0 -5"/>
  <geom name="first" type="box" size="1 1 1"/>
  <geom name="again" type="box" size="1 1 1"/>
  <geom name="cube" type="mesh" mesh="cube"/>
  <geom name="drum" type="cylinder" size="1 1"/>
  <body name="lid" pos="0 0 2"><geom name="lid" type="box" size="1 1 .1" group="2"/></body>
  <geom name="glass" type="box" size="1 1 .1" pos="0 0 3" material="clear"/>
  <geom name="ghost" type="box" size="1 1 .1" pos="0 0 4" group="5"/>
</worldbody></mujoco>)";

struct Layers {
  TestModel m{kLayers};
  RayScene scene;
  explicit Layers(Isa isa) : scene(m.model, 1, isa) { scene.update(m.world()); }
  int id(const char* name) const { return mj_name2id(m.model, mjOBJ_GEOM, name); }
  Hit down(const RayFilter& filter, double z = 9, double x = 0.3) const {
    const double o[3] = {x, 0.2, z}, d[3] = {0, 0, -1};
    return scene.trace(0, filter, o, d);
  }
};

TEST_P(Kernels, FiltersSelectGeoms) {
  const Layers s(isa());
  EXPECT_EQ(s.down({}).geom, s.id("ghost"));
  EXPECT_EQ(s.down({.groups = 0x1f}).geom, s.id("lid"));
  EXPECT_EQ(s.down({.groups = 0x1f, .transparent = true}).geom, s.id("glass"));
  EXPECT_EQ(s.down({.groups = 0x1f, .exclude_body = 1}).geom, s.id("first"));
  EXPECT_EQ(s.down({.groups = 0x20}).geom, s.id("ghost"));
  EXPECT_EQ(s.down({.groups = 0x04}).geom, s.id("lid"));
  EXPECT_EQ(s.down({.groups = 0x08}).geom, -1);
  std::vector<std::uint8_t> hidden(s.scene.num_objects(), 0);
  hidden[s.id("ghost")] = hidden[s.id("lid")] = 1;
  EXPECT_EQ(s.down({.hidden = hidden}).geom, s.id("first"));
  EXPECT_EQ(s.down({}).geom, s.id("ghost")) << "the filter of one query is not another's";
}

TEST_P(Kernels, TiesGoToTheLowerGeom) {
  const Layers s(isa());
  const RayFilter low{.groups = 1};
  for (double x : {0.0, 0.1, 0.3, 0.7}) EXPECT_EQ(s.down(low, 9, x).geom, s.id("first"));
  std::vector<std::uint8_t> hidden(s.scene.num_objects(), 0);
  hidden[s.id("first")] = hidden[s.id("again")] = 1;
  // The other candidate, "drum", has a higher id.
  EXPECT_EQ(s.down({.groups = 1, .hidden = hidden}).geom, s.id("cube"));
}

// Two geoms side by side; half of the rays meet the one with the higher id first:
//
//        \  |  /
//   ______\_|_/______
//  |   1   |   0    |      rays to the border between them
TEST_P(Kernels, NeighboursThatTieGoToTheLowerGeom) {
  Rng rng(21, 0, 0, 0);
  std::string hills, mirrored;
  for (int r = 0; r < 9; ++r) {
    std::vector<double> row;
    for (int c = 0; c < 9; ++c) row.push_back(r == 4 && c < 2 ? c : rng.uniform(0, 1));
    for (int c = 0; c < 9; ++c) hills += testing::vec({row[c]});
    for (int c = 0; c < 9; ++c) mirrored += testing::vec({row[8 - c]});
  }
  const std::string assets =
      "<mujoco><asset><mesh name='cube' vertex='-1 -1 -1 1 -1 -1 1 1 -1 -1 1 -1 -1 -1 1 1 -1 1 1 1 "
      "1 "
      "-1 1 1'/><hfield name='right' nrow='9' ncol='9' size='1 1 .5 .1' elevation='" +
      hills + "'/><hfield name='left' nrow='9' ncol='9' size='1 1 .5 .1' elevation='" + mirrored +
      "'/></asset><worldbody>";
  const char* pairs[][2] = {{"type='hfield' hfield='right'", "type='hfield' hfield='left'"},
                            {"type='box' size='1 1 1'", "type='box' size='1 1 1'"},
                            {"type='box' size='1 1 1'", "type='mesh' mesh='cube'"}};
  for (const auto& [right, left] : pairs) {
    const TestModel m(assets + "<geom " + right + " pos='1 0 0'/><geom " + left +
                      " pos='-1 0 0'/></worldbody></mujoco>");
    RayScene scene(m.model, 1, isa());
    scene.update(m.world());
    int ties = 0, wrong = 0;
    for (int i = 0; i < 4000; ++i) {
      const double y = rng.uniform(-0.99, 0.99), top[3] = {1e-9, y, 3}, down[3] = {0, 0, -1};
      double o[3] = {(i % 2 ? 1 : -1) * rng.uniform(1, 4), rng.uniform(-1, 1), 3};
      double d[3] = {-o[0], y - o[1], 0};
      d[2] = -mujoco_ray(m, top, down).t;  // the surface at the border
      mju_normalize3(d);
      double t[2];
      for (int g = 0; g < 2; ++g) {
        t[g] = m.model->geom_type[g] == mjGEOM_HFIELD
                   ? mj_rayHfield(m.model, m.data, g, o, d, nullptr)
               : m.model->geom_type[g] == mjGEOM_MESH
                   ? mj_rayMesh(m.model, m.data, g, o, d, nullptr)
                   : mju_rayGeom(m.data->geom_xpos + 3 * g, m.data->geom_xmat + 9 * g,
                                 m.model->geom_size + 3 * g, o, d, m.model->geom_type[g], nullptr);
      }
      if (t[0] < 0 || t[1] < 0 || std::abs(t[0] - t[1]) > 1e-9) continue;
      ++ties;
      wrong += scene.trace(0, {}, o, d).geom != 0;
    }
    EXPECT_GT(ties, 400) << right;
    EXPECT_EQ(wrong, 0) << "of " << ties << ": " << right << ", " << left;
  }
}

// Rays that are almost parallel to the border between two geoms, or exactly, and meet it where it
// reaches the surface. Between boxes and meshes the lower id wins and no ray slips into the border.
// Height fields decide within the error of float32 in the distance to a face that is almost parallel.
TEST_P(Kernels, RaysAlongABorderDoNotSlipIntoIt) {
  constexpr const char* kCube =
      "vertex='-.1 -.1 -.1 .1 -.1 -.1 .1 .1 -.1 -.1 .1 -.1 -.1 -.1 .1 .1 -.1 .1 .1 .1 .1 -.1 .1 "
      ".1'";
  const std::string assets = fmt::format(
      "<mujoco><asset><mesh name='cube' {}/><hfield name='flat' nrow='2' ncol='2' size='.1 .1 .1 "
      ".1' "
      "elevation='0 0 1 1'/></asset><worldbody>",
      kCube);
  const char* box = "type='box' size='.1 .1 .1'";
  const char* field = "type='hfield' hfield='flat'";
  for (const char* left : {box, "type='mesh' mesh='cube'", field}) {
    const bool fields = left == field;
    const TestModel m(assets + "<geom " + (fields ? field : box) + " pos='.5 0 0'/><geom " + left +
                      " pos='.3 0 0'/></worldbody></mujoco>");
    RayScene scene(m.model, 1, isa());
    scene.update(m.world());
    Rng rng(22, 0, 0, 0);
    int wrong = 0;
    for (int i = 0; i < 20000; ++i) {
      const double slope = i % 50 ? std::pow(10, rng.uniform(-6, 0)) : 0;
      const double y = rng.uniform(-0.099, 0.099), top[3] = {0.4, y, 3}, down[3] = {0, 0, -1};
      const double z = fields ? 3 - mujoco_ray(m, top, down).t : 0.1, length = rng.uniform(1, 5);
      double d[3] = {i % 2 ? slope : -slope, rng.uniform(-0.5, 0.5), -1};
      mju_normalize3(d);
      const double o[3] = {0.4 - length * d[0], y - length * d[1], z - length * d[2]};
      const Hit hit = scene.trace(0, {}, o, d);
      if (!fields) {
        wrong += hit.geom != 0;
        EXPECT_NEAR(hit.t, length, 2e-6);
      } else {
        EXPECT_NEAR(hit.t, length, std::min(0.2, 4e-6 + 4e-7 * length / std::abs(d[0])));
      }
    }
    EXPECT_EQ(wrong, 0) << left;
  }
}

TEST_P(Kernels, BackFacesAreCulledIfAsked) {
  const Layers s(isa());
  const auto inside = [&](const char* only, RayFilter::Backfaces backfaces) {
    std::vector<std::uint8_t> hidden(s.scene.num_objects(), 1);
    hidden[s.id(only)] = hidden[s.id("floor")] = 0;
    return s.down({.backfaces = backfaces, .hidden = hidden}, 0).geom;
  };
  using B = RayFilter::Backfaces;
  EXPECT_EQ(inside("cube", B::kHit), s.id("cube"));
  EXPECT_EQ(inside("first", B::kHit), s.id("first"));
  EXPECT_EQ(inside("cube", B::kCullMesh), s.id("floor"));
  EXPECT_EQ(inside("first", B::kCullMesh), s.id("first"));
  EXPECT_EQ(inside("cube", B::kCull), s.id("floor"));
  EXPECT_EQ(inside("first", B::kCull), s.id("floor"));
  EXPECT_EQ(inside("drum", B::kCull), s.id("floor"));
}

// Vertical rays onto and past a mesh. Those in the plane of a side of its bounding box must not
// enter it.
TEST_P(Kernels, RaysInThePlaneOfABoxSideMissTheMesh) {
  const Layers s(isa());
  std::vector<std::uint8_t> hidden(s.scene.num_objects(), 1);
  hidden[s.id("cube")] = 0;
  RayScratch scratch(s.scene.num_objects());
  RayPacket rays{};
  for (int i = 0; i < kPacket; ++i) {
    rays.o[0][i] = 0.4f * static_cast<float>(i) - 3.1f;
    rays.o[2][i] = 9;
    rays.d[2][i] = -1;
    rays.tmax[i] = i % 2 ? 100.0f : std::numeric_limits<float>::infinity();
  }
  const RayFilter filter{.hidden = hidden};
  HitPacket hits;
  s.scene.trace(0, filter, rays, hits, scratch);
  for (int i = 0; i < kPacket; ++i) {
    const bool on = std::abs(rays.o[0][i]) < 1;
    EXPECT_EQ(hits.geom[i], on ? s.id("cube") : -1) << i;
  }
}

TEST_P(Kernels, InfinitePlanesAreInfinite) {
  const Layers s(isa());
  for (double x : {1e3, 1e5, -1e7}) {
    const double o[3] = {x, 2 * x, 20}, d[3] = {0, 0, -1};
    const Hit hit = s.scene.trace(0, {}, o, d);
    EXPECT_EQ(hit.geom, s.id("floor"));
    EXPECT_NEAR(hit.t, 25, 1e-5);
  }
}

TEST(RayScene, PerWorldSizesAndVisibility) {
  TestModel m(kLayers);
  RayScene scene(m.model, 2);
  mjModel* own = mj_copyModel(nullptr, m.model);
  const int ghost = mj_name2id(own, mjOBJ_GEOM, "ghost"), lid = mj_name2id(own, mjOBJ_GEOM, "lid");
  own->geom_rgba[4 * ghost + 3] = 0;
  own->geom_size[3 * lid + 2] = 0.4;
  World second = m.world(1);
  second.model = own;
  scene.update(m.world(0));
  scene.update(second);
  const double o[3] = {0, 0, 9}, d[3] = {0, 0, -1};
  EXPECT_EQ(scene.trace(0, {}, o, d).geom, ghost);
  EXPECT_EQ(scene.trace(1, {}, o, d).geom, lid);
  EXPECT_NEAR(scene.trace(1, {}, o, d).t, 9 - 2.4, 1e-6);
  own->geom_size[3 * lid + 2] = 0.2;  // changed again, without motion
  scene.update(second);
  EXPECT_NEAR(scene.trace(1, {}, o, d).t, 9 - 2.2, 1e-6);
  mj_deleteModel(own);
}

TEST(RayScene, ClothIsHitAtItsRadius) {
  const TestModel m(R"(<mujoco><worldbody>
    <flexcomp name="cloth" type="grid" dim="2" count="5 5 1" spacing=".2 .2 .2" radius=".01" pos="0 0 1"><edge equality="true"/></flexcomp>
    <geom type="plane" size="0 0 1"/></worldbody></mujoco>)");
  RayScene scene(m.model, 1);
  scene.update(m.world());
  const double o[3] = {0.05, 0.07, 2}, below[3] = {0.05, 0.07, 0.5};
  const double down[3] = {0, 0, -1}, up[3] = {0, 0, 1}, aside[3] = {-1, 0, 0};
  const Hit hit = scene.trace(0, {}, o, down);
  EXPECT_EQ(hit.geom, m.model->ngeom);  // flex 0
  EXPECT_NEAR(hit.t, 0.99, 1e-6);
  EXPECT_NEAR(hit.normal[2], 1, 1e-6);
  const Hit from_below = scene.trace(0, {}, below, up);
  EXPECT_NEAR(from_below.t, 0.49, 1e-6);
  EXPECT_NEAR(from_below.normal[2], -1, 1e-6);
  // The border is closed: the cloth is a plate 0.8 m wide and 0.02 m thick.
  const double beside[3] = {1, 0.07, 1.005};
  const Hit border = scene.trace(0, {}, beside, aside);
  EXPECT_NEAR(border.t, 0.6, 1e-6);
  EXPECT_NEAR(border.normal[0], 1, 1e-6);
  for (int i = 0; i < m.model->nflexvert; ++i) m.data->flexvert_xpos[3 * i + 2] += 0.25;
  scene.update(m.world());
  EXPECT_NEAR(scene.trace(0, {}, o, down).t, 0.74, 1e-6);
  const double past[3] = {0.5, 0.5, 2};
  EXPECT_EQ(scene.trace(0, {}, past, down).geom, 0);
}

TEST(RayScene, RopeIsHitAtItsRadius) {
  const TestModel m(R"(<mujoco><worldbody>
    <flexcomp name="rope" type="grid" dim="1" count="6 1 1" spacing=".1 .1 .1" radius=".02" pos="0 0 1"><edge equality="true"/></flexcomp>
    </worldbody></mujoco>)");
  RayScene scene(m.model, 1);
  double* x = m.data->flexvert_xpos;
  for (double far : {0.0, 300.0}) {  // precision must not depend on the distance from the origin
    for (int i = 0; i < 6; ++i) {
      x[3 * i] = far + 0.1 * i;
      x[3 * i + 1] = x[3 * i + 2] = 0;
    }
    scene.update(m.world());
    const double down[3] = {0, 0, -1};
    for (double y : {0.0, 0.007, -0.015, 0.0199, 0.0201}) {
      for (double along : {-0.01, 0.05, 0.1, 0.33, 0.51}) {  // the ends are round
        const double o[3] = {far + along, y, 1};
        const double past = along < 0 ? -along : along > 0.5 ? along - 0.5 : 0;
        const double height2 = 4e-4 - y * y - past * past;
        const Hit hit = scene.trace(0, {}, o, down);
        EXPECT_EQ(hit.geom, height2 > 0 ? 0 : -1) << y << ' ' << along;
        if (height2 <= 0) continue;
        EXPECT_NEAR(hit.t, 1 - std::sqrt(height2), 2e-6) << y << ' ' << along;
        EXPECT_NEAR(hit.normal[2], std::sqrt(height2) / 0.02, 2e-3);
        EXPECT_NEAR(hit.normal[1], y / 0.02, 2e-3);
      }
    }
  }
}

TEST(RayScene, SoftSolidIsHitAtItsRadius) {
  const TestModel m(R"(<mujoco><worldbody>
    <flexcomp name="jelly" type="grid" dim="3" count="5 5 5" spacing=".1 .1 .1" radius=".01" pos="0 0 1"><edge equality="true"/></flexcomp>
    </worldbody></mujoco>)");
  RayScene scene(m.model, 2);
  for (int w : {0, 1}) {  // each world has its own shape
    for (int i = 0; i < m.model->nflexvert; ++i) m.data->flexvert_xpos[3 * i + 2] += 0.5 * w;
    scene.update(m.world(w));
  }
  const double o[3] = {0.03, 0.02, 3}, down[3] = {0, 0, -1};
  for (int w : {0, 1}) {
    const Hit hit = scene.trace(w, {}, o, down);
    EXPECT_EQ(hit.geom, 0);
    EXPECT_NEAR(hit.t, 3 - 1.21 - 0.5 * w, 1e-6);
    const double inside[3] = {0.03, 0.02, 1 + 0.5 * w};
    EXPECT_NEAR(scene.trace(w, {}, inside, down).t, 0.21, 1e-6);
  }
}

// The only allocation is a name that Embree creates for its own log at every refit.
TEST(RayScene, MovingFlexAllocatesOnlyInsideEmbree) {
  const TestModel m(R"(<mujoco><worldbody>
    <flexcomp name="cloth" type="grid" dim="2" count="9 9 1" spacing=".2 .2 .2" radius=".01"/>
    <flexcomp name="rope" type="grid" dim="1" count="5 1 1" spacing=".2 .2 .2" radius=".01"/>
    </worldbody></mujoco>)");
  RayScene scene(m.model, 1);
  const auto moved = [&] {
    for (int i = 0; i < 3 * m.model->nflexvert; ++i) m.data->flexvert_xpos[i] += 0.01;
    const AllocationCount count;
    scene.update(m.world());
    return count.since();
  };
  moved();
  EXPECT_LE(moved(), 2);
  const AllocationCount at_rest;
  scene.update(m.world());
  EXPECT_EQ(at_rest.since(), 0);
}

TEST(RayScene, AllocatesNothingAfterTheFirstRay) {
  Rng rng(6, 0, 0, 0);
  const TestModel m(
      testing::random_scene(rng, {"plane", "sphere", "capsule", "box", "mesh", "hfield"}, 60, 4));
  RayScene scene(m.model, 1);
  RayScratch scratch(scene.num_objects());
  scene.update(m.world());
  const AllocationCount count;
  HitPacket hits;
  for (int i = 0; i < 100; ++i) {
    scene.update(m.world());
    const RayPacket rays = random_packet(rng, 5, 0.3);
    scene.trace(0, {}, rays, hits, scratch);
  }
  EXPECT_EQ(count.since(), 0);
}

}  // namespace
}  // namespace mjsense::rays
