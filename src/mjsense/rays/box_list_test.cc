// SPDX-License-Identifier: Apache-2.0
// Worlds with many geoms: grouping boxes into blocks must not change any hit.
#include "mjsense/rays/box_list.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/kernels.h"
#include "mjsense/rays/testing/scene.h"

namespace mjsense::rays {
namespace {

class ManyGeoms : public testing::EveryKernel {};
INSTANTIATE_TEST_SUITE_P(Isas, ManyGeoms, testing::every_isa(), testing::isa_of);

// A floor and 900 solids in a hall of 20 m; a third of them are on moving bodies.
std::string hall(Rng& rng) {
  std::string xml = "<mujoco><worldbody><geom type='plane' size='0 0 1'/>";
  const char* const kinds[] = {"sphere", "box", "capsule"};
  for (int i = 0; i < 900; ++i) {
    const std::string geom =
        std::string("<geom type='") + kinds[rng.below(3)] + "' size='" +
        testing::vec({rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.3)}) +
        "'";
    const std::string pos =
        " pos='" + testing::vec({rng.uniform(-10, 10), rng.uniform(-10, 10), rng.uniform(0, 3)}) +
        "'";
    xml += i % 3 ? geom + pos + "/>" : "<body" + pos + "><freejoint/>" + geom + "/></body>";
  }
  return xml + "</worldbody></mujoco>";
}

// 16 rays of one origin, in a narrow or a wide fan.
RayPacket fan(Rng& rng) {
  RayPacket rays{};
  double middle[3];
  testing::random_direction(rng, middle);
  const double width = rng.below(3) == 0 ? 2.0 : 0.05;
  for (int k = 0; k < 3; ++k) rays.origin[k] = rng.uniform(-9, 9);
  rays.origin[2] = rng.uniform(0.1, 4);
  for (int i = 0; i < kPacket; ++i) {
    double d[3];
    for (int k = 0; k < 3; ++k) d[k] = middle[k] + width * rng.uniform(-0.5, 0.5);
    mju_normalize3(d);
    for (int k = 0; k < 3; ++k) rays.d[k][i] = static_cast<float>(d[k]);
    rays.tmax[i] = rng.below(8) == 0 ? 5.0f : kNoHit;
  }
  return rays;
}

TEST_P(ManyGeoms, BlocksDoNotChangeHits) {
  Rng rng(3, 0, 0, 0);
  const TestModel m(hall(rng));
  ASSERT_GE(m.model->ngeom, BoxList::kMany);
  RayScene scene(m.model, 1, isa());
  RayScratch scratch(scene.num_objects()), all(scene.num_objects());
  long hits = 0;
  for (int pose = 0; pose < 3; ++pose) {
    scene.update(m.world());
    for (int n = 0; n < 3000; ++n) {
      const RayPacket rays = fan(rng);
      const RayFilter filter{.exclude_body = n % 5 ? -1 : 7};
      HitPacket found, expected, focused;
      scene.trace(0, filter, rays, found, scratch);
      scene.cull(0, filter, {&rays, 1}, scratch);
      scene.trace_culled(0, filter, rays, focused, scratch);
      all.count = 0;
      for (int g = 0; g < scene.num_objects(); ++g) {
        if (m.model->geom_bodyid[g] != filter.exclude_body) all.data()[all.count++] = {0.0f, g};
      }
      scene.trace_candidates(0, filter, rays, expected, all.candidates());
      for (int i = 0; i < kPacket; ++i) {
        ASSERT_EQ(found.t[i], expected.t[i]) << n << " " << i;
        ASSERT_EQ(found.geom[i], expected.geom[i]) << n << " " << i;
        ASSERT_EQ(focused.t[i], expected.t[i]) << n << " " << i;
        hits += found.geom[i] > 0;
      }
    }
    // Move the bodies far from where the blocks were computed.
    for (int j = 0; j < m.model->njnt; ++j) {
      for (int k = 0; k < 3; ++k)
        m.data->qpos[m.model->jnt_qposadr[j] + k] =
            k < 2 ? rng.uniform(-10, 10) : rng.uniform(0, 3);
    }
    mj_forward(m.model, m.data);
  }
  EXPECT_GT(hits, 20000);
}

TEST(BoxList, BlocksSurroundTheirBoxes) {
  const int count = 1000;
  BoxList list(count);
  Rng rng(1, 0, 0, 0);
  const auto place = [&](int i) {
    float low[3], high[3];
    for (int k = 0; k < 3; ++k) {
      low[k] = static_cast<float>(rng.uniform(-50, 50));
      high[k] = low[k] + 0.5f;
    }
    if (i == 17) low[0] = -1e30f, high[0] = 1e30f;  // a plane
    list.set(i, low, high);
  };
  for (int i = 0; i < count; ++i) place(i);
  list.update();
  for (int round = 0; round < 3; ++round) {
    const KernelBoxes all = list.all(), blocks = list.blocks();
    ASSERT_EQ(blocks.count, (count + KernelWorld::kBlock - 1) / KernelWorld::kBlock);
    std::vector<int> seen(count, 0);
    double size = 0;
    for (int at = 0; at < count; ++at) {
      const int block = at / KernelWorld::kBlock;
      ++seen[all.ids[at]];
      EXPECT_EQ(list.box_of_geom()[all.ids[at]], at);
      for (int k = 0; k < 3; ++k) {
        EXPECT_LE(blocks.low[k][block], all.low[k][at]);
        EXPECT_GE(blocks.high[k][block], all.high[k][at]);
      }
    }
    EXPECT_EQ(std::ranges::count(seen, 1), count);
    for (int b = 1; b < blocks.count; ++b)
      size += (blocks.high[1][b] - blocks.low[1][b]) / blocks.count;
    if (round == 0) {
      EXPECT_LT(size, 60);  // m, mean over the blocks; for 64 random boxes it would be nearly 100
    }
    for (int n = 0; n < 20; ++n) place(static_cast<int>(rng.below(count)));
    list.update();
  }
}

TEST(BoxList, FewObjectsHaveNoBlocks) {
  BoxList list(100);
  EXPECT_EQ(list.blocks().count, 0);
  EXPECT_EQ(list.all().ids, nullptr);
  EXPECT_EQ(list.box_of_geom(), nullptr);
  EXPECT_EQ(list.padded(), 112);
}

}  // namespace
}  // namespace mjsense::rays
