// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/debug_shapes.h"

#include <gtest/gtest.h>

#include <string>

namespace mjsense {
namespace {

class SceneOf {
 public:
  explicit SceneOf(int room) {
    mjv_defaultScene(&scene);
    mjv_makeScene(nullptr, &scene, room);
  }
  ~SceneOf() { mjv_freeScene(&scene); }
  mjvScene scene;
};

TEST(DebugShapes, EqualMuJoCoConnectors) {
  DebugShapes shapes(0.03);
  shapes.add_arrow({1, 2, 3}, {1, 2, 5}, 0.1, {1, 0, 0, 1}, "up");
  shapes.add_line({0, 0, 0}, {3, 0, 4}, 2, {0, 1, 0, 0.5f}, "line");
  shapes.add_sphere({4, 5, 6}, 0.2, {0, 0, 1, 1}, std::string(200, 'x'));
  SceneOf s(10);
  EXPECT_EQ(shapes.append_to(&s.scene, true), 0);
  ASSERT_EQ(s.scene.ngeom, 3);
  const mjvGeom* g = s.scene.geoms;
  EXPECT_EQ(g[0].type, mjGEOM_ARROW);
  EXPECT_EQ(g[0].category, mjCAT_DECOR);
  EXPECT_FLOAT_EQ(g[0].pos[2], 3);
  EXPECT_FLOAT_EQ(g[0].mat[8], 1);   // the z axis points along the arrow
  EXPECT_FLOAT_EQ(g[0].size[2], 2);  // length of the arrow
  EXPECT_STREQ(g[0].label, "up");
  EXPECT_EQ(g[1].type, mjGEOM_LINE);
  EXPECT_FLOAT_EQ(g[1].size[2], 5);
  EXPECT_FLOAT_EQ(g[1].mat[2], 0.6f);
  EXPECT_FLOAT_EQ(g[1].rgba[3], 0.5f);
  EXPECT_EQ(g[2].type, mjGEOM_SPHERE);
  EXPECT_FLOAT_EQ(g[2].pos[0], 4);
  EXPECT_FLOAT_EQ(g[2].size[0], 0.2f);
  EXPECT_EQ(std::string(g[2].label), std::string(99, 'x'));
}

TEST(DebugShapes, FrameIsThreeArrows) {
  DebugShapes shapes(0.03);
  const double quarter_about_z[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  shapes.add_frame({1, 1, 1}, quarter_about_z, 0.5, 0.01, "f");
  ASSERT_EQ(shapes.list().size(), 3u);
  EXPECT_DOUBLE_EQ(shapes.list()[0].vector.y, 0.5);
  EXPECT_DOUBLE_EQ(shapes.list()[1].vector.x, -0.5);
  EXPECT_DOUBLE_EQ(shapes.list()[2].vector.z, 0.5);
  EXPECT_EQ(shapes.list()[1].label, "f_y");
}

TEST(DebugShapes, ReportsShapesThatDoNotFit) {
  DebugShapes shapes(0.03);
  for (int i = 0; i < 5; ++i) shapes.add_sphere({}, 1, {}, "hidden");
  SceneOf s(3);
  s.scene.ngeom = 1;  // a geom that was in the scene before
  EXPECT_EQ(shapes.append_to(&s.scene), 3);
  EXPECT_EQ(s.scene.ngeom, 3);
  EXPECT_STREQ(s.scene.geoms[1].label, "");
}

}  // namespace
}  // namespace mjsense
