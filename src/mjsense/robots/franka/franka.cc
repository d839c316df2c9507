// SPDX-License-Identifier: Apache-2.0
#include "mjsense/robots/franka/franka.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>

#include "mjsense/core/error.h"
#include "mjsense/scene/spec.h"

namespace mjsense {
namespace {

constexpr int kLinks = 8;

std::string mesh_file(const std::string& folder, int link) {
  return fmt::format("{}/link{}.stl", folder, link);
}

void check_meshes(const std::string& folder) {
  for (int i = 0; i < kLinks; ++i) {
    if (!std::filesystem::is_regular_file(mesh_file(folder, i))) {
      throw ValueError(fmt::format(
          "MJSENSE_FRANKA_MESHES: '{}' is no file; the folder must hold link0.stl ... link7.stl",
          mesh_file(folder, i)));
    }
  }
}

}  // namespace

RobotCfg franka_cfg() {
  RobotCfg cfg;
  cfg.name = "franka";
  cfg.model.path = "embedded:franka/fr3.xml";
  cfg.base_body = "base";

  MoveGroupCfg base;
  base.name = "base";
  base.kind = GroupKind::kBase;
  base.root_body = "base";

  MoveGroupCfg arm;
  arm.name = "arm";
  arm.kind = GroupKind::kArm;
  for (int i = 1; i <= 7; ++i) arm.joints.push_back("fr3_joint" + std::to_string(i));
  arm.actuators = arm.joints;
  arm.leaf_site = "gripper/grasp_site";
  arm.root_body = "fr3_link0";
  arm.init = {0, -0.7853, 0, -2.35619, 0, 1.57079, 0};
  arm.spread = {0.025, 0.05, 0.075, 0.1, 0.125, 0.15, 0.175};

  MoveGroupCfg gripper;
  gripper.name = "gripper";
  gripper.kind = GroupKind::kGripper;
  gripper.joints = {"gripper/left_driver_joint", "gripper/right_driver_joint"};
  gripper.actuators = {"gripper/fingers_actuator"};
  gripper.leaf_site = "gripper/grasp_site";
  gripper.root_body = "gripper/base";
  gripper.init = {0.00296, 0.00296};
  gripper.open_command = 0;
  gripper.closed_command = 255;
  gripper.max_opening = 0.087;
  gripper.pad_half_width = 0.011;
  gripper.pad_half_length = 0.019;
  gripper.pad_sites = {"gripper/left_pad", "gripper/right_pad"};

  cfg.groups = {base, arm, gripper};
  cfg.env_state_name = "panda";  // MolmoSpaces' name and width: 9 + 9 and zeros
  cfg.env_state_size = 31;
  cfg.cameras = {{"wrist_camera", "gripper/wrist_camera"}, {"exo_camera_1", "exo_camera_1"}};

  const char* meshes = std::getenv("MJSENSE_FRANKA_MESHES");
  if (meshes && *meshes) {
    const std::string folder = meshes;
    check_meshes(folder);
    cfg.edit_spec = [folder](mjSpec* spec, const std::string& prefix) {
      use_franka_meshes(spec, prefix, folder);
    };
  }
  return cfg;
}

void use_franka_meshes(mjSpec* spec, const std::string& prefix, const std::string& folder) {
  std::vector<mjsElement*> shapes;
  for (mjsElement* geom : spec_elements(spec, mjOBJ_GEOM)) {
    if (element_name(geom).starts_with(prefix + "shape_")) shapes.push_back(geom);
  }
  for (mjsElement* shape : shapes) mjs_delete(spec, shape);
  for (int i = 0; i < kLinks; ++i) {
    const std::string name = fmt::format("{}fr3_link{}", prefix, i);
    mjsMesh* mesh = mjs_addMesh(spec, nullptr);
    mjs_setName(mesh->element, name.c_str());
    mjs_setString(mesh->file, mesh_file(folder, i).c_str());
    mjsBody* body = mjs_asBody(find_in_spec(spec, mjOBJ_BODY, name, "robot 'franka'"));
    mjsGeom* geom = mjs_addGeom(body, nullptr);
    mjs_setName(geom->element, (name + "_mesh").c_str());
    geom->type = mjGEOM_MESH;
    geom->group = 2;
    geom->contype = geom->conaffinity = 0;
    geom->mass = 0;
    mjs_setString(geom->meshname, name.c_str());
    mjs_setString(geom->material, (prefix + "fr3_white").c_str());
  }
}

}  // namespace mjsense
