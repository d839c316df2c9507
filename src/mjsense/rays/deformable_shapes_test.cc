// SPDX-License-Identifier: Apache-2.0
// Compares flexes and skins with MuJoCo's visualiser, for random poses of vertices and bones.

#include <gtest/gtest.h>

#include <algorithm>

#include "mjsense/core/testing/allocations.h"
#include "mjsense/rays/flex_shapes.h"
#include "mjsense/rays/shared_geometry.h"
#include "mjsense/rays/skin_shapes.h"
#include "mjsense/rays/testing/scene.h"

namespace mjsense::rays {
namespace {

// MuJoCo's abstract scene of the model.
struct Drawn {
  mjvScene scene;
  mjvOption option;

  explicit Drawn(const TestModel& m) {
    mjv_defaultScene(&scene);
    mjv_defaultOption(&option);
    mjv_makeScene(m.model, &scene, 100);
    mjvCamera camera;
    mjv_defaultCamera(&camera);
    mjv_updateScene(m.model, m.data, &option, nullptr, &camera, mjCAT_ALL, &scene);
  }
  ~Drawn() { mjv_freeScene(&scene); }
  Drawn(const Drawn&) = delete;
  Drawn& operator=(const Drawn&) = delete;
};

// Compares box [6] with the bounding box of points [count, 3] relative to `origin`.
void expect_box(const float* box, const float* points, int count, const double* origin) {
  for (int k = 0; k < 3; ++k) {
    double low = 1e30, high = -1e30;
    for (int i = 0; i < count; ++i) {
      low = std::min<double>(low, points[3 * i + k] - origin[k]);
      high = std::max<double>(high, points[3 * i + k] - origin[k]);
    }
    EXPECT_NEAR(box[k] - box[3 + k], low, 1e-6);
    EXPECT_NEAR(box[k] + box[3 + k], high, 1e-6);
  }
}

constexpr char kFlexes[] = R"(<mujoco><worldbody>
  <flexcomp name="cloth" type="grid" dim="2" count="6 5 1" spacing=".1 .1 .1" radius=".02"/>
  <flexcomp name="flat" type="grid" dim="2" count="3 3 1" spacing=".1 .1 .1" radius=".01" flatskin="true"/>
  <flexcomp name="jelly" type="grid" dim="3" count="4 3 3" spacing=".1 .1 .1" radius=".01"/>
  <camera/></worldbody></mujoco>)";

TEST(FlexShapes, FacesAndNormalsEqualMuJoCo) {
  const TestModel m(kFlexes);
  const SharedGeometry shared(m.model);
  FlexShapes shapes(shared.device.get(), shared.flexes, m.model);
  Rng rng(3, 0, 0, 0);
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 3 * m.model->nflexvert; ++i)
      m.data->flexvert_xpos[i] += rng.uniform(-0.02, 0.02);
    shapes.update(m.model, m.data);
    const Drawn drawn(m);
    for (int f = 0; f < m.model->nflex; ++f) {
      const int faces = drawn.scene.flexfaceused[f];
      const int first = 9 * drawn.scene.flexfaceadr[f];
      ASSERT_EQ(shared.flexes[f].num_faces(), faces);
      expect_box(shapes.box(f), drawn.scene.flexface + first, 3 * faces, shapes.position(f));
      const float* normals = shapes.parts()[f].normals;
      const int sheets = 9 * (faces - 2 * (f < 2 ? m.model->flex_shellnum[f] : 0));
      for (int i = 0; i < sheets; ++i)
        ASSERT_NEAR(normals[i], drawn.scene.flexnormal[first + i], 1e-6) << f << ' ' << i;
      for (int i = sheets; i < 9 * faces; i += 3) {
        double cosine = 0;
        for (int k = 0; k < 3; ++k)
          cosine += normals[i + k] * drawn.scene.flexnormal[first + i + k];
        EXPECT_GT(cosine, 0.8);
      }
    }
  }
}

// Three materials: one part per material, equal to what MuJoCo draws in that material.
void expect_a_part_for_each(const std::string& materials, int count) {
  const TestModel m(
      R"(<mujoco><asset><material name="a" rgba="1 0 0 1"/><material name="b" rgba="0 1 0 1"/>
    <material name="c" rgba="0 0 1 1"/></asset><worldbody><camera/></worldbody>
    <deformable><flex name="f" dim="2" body="world" radius=".01" material=")" +
      materials + R"("
      vertex="0 0 1 1 0 1 0 1 1 1 1 1 2 0 1 2 1 1" element="0 1 2 1 3 2 1 4 3 4 5 3"/></deformable></mujoco>)");
  const SharedGeometry shared(m.model);
  FlexShapes shapes(shared.device.get(), shared.flexes, m.model);
  shapes.update(m.model, m.data);
  const Drawn drawn(m);
  ASSERT_EQ(drawn.scene.ngeom, count);
  ASSERT_EQ(static_cast<int>(shapes.parts().size()), count);
  for (int i = 0; i < count; ++i) {
    const mjvGeom& g = drawn.scene.geoms[i];  // size: radius, first face, number of faces
    const FlexSurface::Part& part = shared.flexes[0].parts[i];
    EXPECT_EQ(part.first, g.size[1]);
    EXPECT_EQ(part.count, g.size[2]);
    for (int k = 0; k < 4; ++k)
      EXPECT_EQ(m.model->mat_rgba[4 * shapes.parts()[i].material + k], g.rgba[k]);
    EXPECT_NE(shapes.parts()[i].scene, shapes.scenes()[0]);
  }
}

TEST(FlexShapes, EveryMaterialHasAPart) {
  expect_a_part_for_each("b a c b", 3);
  expect_a_part_for_each("b a b b", 2);
}

// A strip of 12 vertices along x with two bones; the second is bound at an angle.
constexpr char kSkin[] = R"(<mujoco><worldbody>
  <body name="a" pos=".1 .2 .3" euler="10 20 30"><joint type="ball"/><geom size=".01"/>
    <body name="b" pos=".3 0 0" euler="0 0 20"><joint type="ball"/><geom size=".01"/></body></body>
  <camera/></worldbody>
  <deformable><skin name="strip" inflate=".015" group="1"
    vertex="0 -.1 0 0 .1 0  .1 -.1 .02 .1 .1 0  .2 -.1 0 .2 .1 .03  .3 -.1 0 .3 .1 0  .4 -.1 .1 .4 .1 0  .5 -.1 0 .5 .1 0"
    face="0 2 1 1 2 3  2 4 3 3 4 5  4 6 5 5 6 7  6 8 7 7 8 9  8 10 9 9 10 11">
    <bone body="a" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3 4 5 6 7" vertweight="1 1 1 1 .7 .7 .3 .3"/>
    <bone body="b" bindpos=".3 0 0" bindquat=".9 .1 .3 .2" vertid="4 5 6 7 8 9 10 11" vertweight=".3 .3 .7 .7 1 1 1 1"/>
  </skin></deformable></mujoco>)";

TEST(SkinShapes, VerticesAndNormalsEqualMuJoCo) {
  const TestModel m(kSkin);
  const SharedGeometry shared(m.model);
  SkinShapes shapes(shared.device.get(), m.model);
  Rng rng(4, 0, 0, 0);
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < m.model->nq; ++i) m.data->qpos[i] = rng.normal();
    mj_forward(m.model, m.data);
    shapes.update(m.model, m.data);
    shapes.bend(~0u);
    const Drawn drawn(m);
    const RayGeom& g = shapes.geom(0);
    const float box[6] = {g.center[0], g.center[1], g.center[2], g.half[0], g.half[1], g.half[2]};
    expect_box(box, drawn.scene.skinvert, m.model->nskinvert, g.pos);
    for (int i = 0; i < 3 * m.model->nskinface; ++i)
      for (int k = 0; k < 3; ++k)
        ASSERT_NEAR(shapes.normals(0)[3 * i + k],
                    drawn.scene.skinnormal[3 * m.model->skin_face[i] + k], 2e-6);
  }
}

TEST(SkinShapes, BendsOnlyRequestedGroupsThatMoved) {
  const TestModel m(kSkin);
  const SharedGeometry shared(m.model);
  SkinShapes shapes(shared.device.get(), m.model);
  shapes.update(m.model, m.data);
  shapes.bend(1u << 1);
  const float before = shapes.normals(0)[0];
  m.data->qpos[1] = 0.5;
  mj_forward(m.model, m.data);
  shapes.update(m.model, m.data);
  shapes.bend(1u << 0);  // another group
  EXPECT_EQ(shapes.normals(0)[0], before);
  const AllocationCount count;
  shapes.bend(1u << 1);
  EXPECT_NE(shapes.normals(0)[0], before);
  EXPECT_LE(count.since(), 1);  // inside Embree
  const AllocationCount at_rest;
  shapes.update(m.model, m.data);
  shapes.bend(~0u);
  EXPECT_EQ(at_rest.since(), 0);
}

}  // namespace
}  // namespace mjsense::rays
