// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/ray_world.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <utility>

#include "mjsense/rays/box_list.h"
#include "mjsense/rays/shared_geometry.h"
#include "mjsense/rays/testing/scene.h"

namespace mjsense::rays {
namespace {

constexpr int kGeoms = 40;  // more than two of update()'s blocks, and not a multiple of their size

std::string field() {
  std::string xml =
      "<mujoco><asset><material name='a' rgba='1 0 0 1'/><material name='b' rgba='0 1 0 .5'/>"
      "<mesh name='rock' vertex='0 0 0 .1 0 0 0 .1 0 0 0 .1'/>"
      "<mesh name='slab' vertex='0 0 0 .3 0 0 0 .3 0 0 0 .1'/></asset><worldbody>";
  for (int i = 0; i < kGeoms; ++i) {
    xml += fmt::format("<body pos='{} 0 0'><geom {}/></body>", i,
                       i % 4 == 0 ? "type='mesh' mesh='rock'" : "type='box' size='.1 .2 .3'");
  }
  return xml + "</worldbody></mujoco>";
}

void expect_same(const RayWorld& a, const RayWorld& b, const std::string& after) {
  ASSERT_EQ(a.num_objects(), b.num_objects());
  EXPECT_TRUE(std::ranges::equal(a.flags(), b.flags())) << after;
  EXPECT_TRUE(std::ranges::equal(a.bodies(), b.bodies())) << after;
  EXPECT_TRUE(std::ranges::equal(a.materials(), b.materials())) << after;
  EXPECT_TRUE(std::ranges::equal(a.rgba(), b.rgba())) << after;
  for (int i = 0; i < a.num_objects(); ++i) {
    const RayGeom &g = a.geom(i), &h = b.geom(i);
    EXPECT_TRUE(std::ranges::equal(g.pos, h.pos) && std::ranges::equal(g.mat, h.mat) &&
                std::ranges::equal(g.rot, h.rot) && std::ranges::equal(g.size, h.size) &&
                std::ranges::equal(g.center, h.center) && std::ranges::equal(g.half, h.half) &&
                g.type == h.type && g.data == h.data)
        << "geom " << i << " after " << after;
    for (int c = 0; c < 3; ++c) {
      EXPECT_EQ(a.boxes().all().low[c][i], b.boxes().all().low[c][i]) << after;
      EXPECT_EQ(a.boxes().all().high[c][i], b.boxes().all().high[c][i]) << after;
    }
  }
}

TEST(RayWorld, UpdateDetectsEveryChange) {
  const TestModel model(field());
  mjModel* m = model.model;
  mjData* d = model.data;
  const SharedGeometry shapes(m);
  RayWorld kept(m, shapes);
  const auto look = [&](const std::string& after) {
    mj_kinematics(m, d);
    kept.update(m, d);
    RayWorld fresh(m, shapes);
    fresh.update(m, d);
    expect_same(kept, fresh, after);
  };
  look("nothing");
  look("nothing again");
  for (const int i : {0, 15, 16, kGeoms - 1}) {
    const std::pair<const char*, std::function<void()>> changes[] = {
        {"geom_pos", [&] { m->geom_pos[3 * i + 1] += 0.5; }},
        {"body_quat", [&] { std::swap(m->body_quat[4 * (i + 1)], m->body_quat[4 * (i + 1) + 3]); }},
        {"geom_size", [&] { m->geom_size[3 * i + 2] += 0.25; }},
        {"geom_rgba", [&] { m->geom_rgba[4 * i + 3] = 0; }},
        {"geom_group", [&] { m->geom_group[i] = 4; }},
        {"geom_matid", [&] { m->geom_matid[i] = i % 2; }},
        {"geom_bodyid", [&] { m->geom_bodyid[i] = 1; }},
        {"geom_type",
         [&] {
           m->geom_type[i] = mjGEOM_ELLIPSOID;
           m->geom_dataid[i] = -1;
         }},
        {"geom_type again",
         [&] {
           m->geom_type[i] = mjGEOM_MESH;
           m->geom_dataid[i] = 1;
         }},
        {"geom_dataid", [&] { m->geom_dataid[i] = 0; }},
        {"mat_rgba", [&] { m->mat_rgba[3] = 0.125f * static_cast<float>(i % 8); }},
    };
    for (const auto& [name, change] : changes) {
      change();
      look(fmt::format("{} of geom {}", name, i));
    }
  }
}

}  // namespace
}  // namespace mjsense::rays
