// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/real_meshes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scene/scene.h"
#include "mjsense_tasks/robots/load_robot.h"

namespace mjsense::tasks::robots {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

// Sets the mesh folder to a temporary folder with eight tetrahedra as meshes.
struct Meshes {
  Meshes() {
    for (int i = 0; i < 8; ++i) {
      std::ofstream file(folder.path / ("link" + std::to_string(i) + ".stl"), std::ios::binary);
      const std::array<char, 80> header{};
      file.write(header.data(), header.size());
      const std::uint32_t count = 4;
      file.write(reinterpret_cast<const char*>(&count), 4);
      const float v[4][3] = {{0, 0, 0}, {0.05f, 0, 0}, {0, 0.05f, 0}, {0, 0, 0.05f}};
      for (const auto& f : {std::array{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}) {
        const float normal[3] = {};
        file.write(reinterpret_cast<const char*>(normal), 12);
        for (int k : f) file.write(reinterpret_cast<const char*>(v[k]), 12);
        file.write("\0\0", 2);
      }
    }
    setenv("MJSENSE_FRANKA_MESHES", folder.path.c_str(), 1);
  }
  ~Meshes() { unsetenv("MJSENSE_FRANKA_MESHES"); }
  testing::TempDir folder;
};

std::unique_ptr<scene::Scene> scene_of(const RobotCfg& robot) {
  scene::SceneCfg cfg;
  scene::EntityCfg entity;
  entity.model = robot.model;
  cfg.entities = {{"robot_0", entity}};
  if (robot.edit_spec) cfg.spec_fn = [&](mjSpec* spec) { robot.edit_spec(spec, "robot_0/"); };
  return std::make_unique<scene::Scene>(cfg);
}

TEST(FrankaMeshes, ReplaceTheShapesAndNothingElse) {
  const auto plain = scene_of(robot_cfg("franka"));
  const Meshes meshes;
  const auto real = scene_of(robot_cfg("franka"));
  const mjModel *a = plain->model(), *b = real->model();
  EXPECT_EQ(a->nmesh, 0);
  EXPECT_EQ(b->nmesh, 8);
  ASSERT_EQ(a->nbody, b->nbody);
  int touched_a = 0, touched_b = 0;
  for (int g = 0; g < a->ngeom; ++g) touched_a += a->geom_contype[g] || a->geom_conaffinity[g];
  for (int g = 0; g < b->ngeom; ++g) {
    touched_b += b->geom_contype[g] || b->geom_conaffinity[g];
    EXPECT_EQ(scene::name_of(b, mjOBJ_GEOM, g).find("shape_"), std::string::npos);
  }
  EXPECT_EQ(touched_a, touched_b);
  for (int i = 0; i < a->nbody; ++i) {
    EXPECT_EQ(a->body_mass[i], b->body_mass[i]);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(a->body_inertia[3 * i + k], b->body_inertia[3 * i + k]);
  }
}

TEST(FrankaMeshes, AnIncompleteFolderIsAnError) {
  const Meshes meshes;
  fs::remove(meshes.folder.path / "link6.stl");
  try {
    robot_cfg("franka");
    FAIL();
  } catch (const ValueError& e) {
    EXPECT_THAT(e.what(), HasSubstr("MJSENSE_FRANKA_MESHES"));
    EXPECT_THAT(e.what(), HasSubstr("link6.stl"));
  }
}

// Camera extrinsics (m, in the frame of their link) and vertical fields of view (degrees) that
// users calibrate against.
TEST(FrankaModel, CamerasHaveTheirPosesAndFieldsOfView) {
  const auto scene = scene_of(robot_cfg("franka"));
  const mjModel* m = scene->model();
  const struct {
    const char *name, *body;
    double pos[3], fovy, right[3], up[3];
  } cameras[] = {
      {"exo_camera_1",
       "fr3_link0",
       {0.1, 0.57, 0.66},
       71,
       {-0.70520, -0.70093, 0.10644},
       {0.48933, -0.37259, 0.78850}},
      {"gripper/wrist_camera", "gripper/base", {0.078, 0, -0.016}, 56.74, {0, 1, 0}, {1, 0, 0}},
  };
  for (const auto& want : cameras) {
    const int camera = scene::resolve(m, mjOBJ_CAMERA, std::string("robot_0/") + want.name, "test");
    EXPECT_EQ(m->cam_bodyid[camera],
              scene::resolve(m, mjOBJ_BODY, std::string("robot_0/") + want.body, "test"));
    EXPECT_NEAR(m->cam_fovy[camera], want.fovy, 1e-5) << want.name;
    double r[9];
    mju_quat2Mat(r, m->cam_quat + 4 * camera);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(m->cam_pos[3 * camera + k], want.pos[k], 1e-9) << want.name;
      EXPECT_NEAR(r[3 * k], want.right[k], 2e-4) << want.name << " right " << k;
      EXPECT_NEAR(r[3 * k + 1], want.up[k], 2e-4) << want.name << " up " << k;
    }
  }
  const RobotCfg cfg = robot_cfg("franka");
  EXPECT_EQ(cfg.image_width, 640);
  EXPECT_EQ(cfg.image_height, 368);
  ASSERT_EQ(cfg.cameras.size(), 2u);
  EXPECT_EQ(cfg.cameras[0].name, "wrist_camera");
  EXPECT_EQ(cfg.cameras[0].mjcf_camera, "gripper/wrist_camera");
  EXPECT_EQ(cfg.cameras[1].name, "exo_camera_1");
}

TEST(FrankaModel, MassesAreThePublishedOnes) {
  const auto scene = scene_of(robot_cfg("franka"));
  const mjModel* m = scene->model();
  const double masses[] = {2.3966,       2.9274653454, 2.9355370338, 2.2449013699,
                           2.6155955791, 2.3271207594, 1.8170376524, 0.6271432862};
  for (int i = 0; i < 8; ++i) {
    const int body = scene::resolve(m, mjOBJ_BODY, "robot_0/fr3_link" + std::to_string(i), "test");
    EXPECT_NEAR(m->body_mass[body], masses[i], 1e-9);
  }
}

}  // namespace
}  // namespace mjsense::tasks::robots
