// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/real_meshes.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scene/mj_spec.h"

namespace mjsense::tasks::robots {
namespace {

namespace fs = std::filesystem;

void replace(const MeshesCfg& cfg, const fs::path& folder, mjSpec* spec,
             const std::string& prefix) {
  const Regex pattern(cfg.replace, "meshes.replace");
  std::vector<mjsElement*> shapes;
  for (mjsElement* geom : scene::spec_elements(spec, mjOBJ_GEOM)) {
    const std::string name = scene::element_name(geom);
    if (name.starts_with(prefix) && pattern.fullmatch(name.substr(prefix.size())))
      shapes.push_back(geom);
  }
  for (mjsElement* shape : shapes) mjs_delete(spec, shape);
  for (const auto& [body_name, file] : cfg.files) {
    const std::string name = prefix + body_name;
    mjsMesh* mesh = mjs_addMesh(spec, nullptr);
    mjs_setName(mesh->element, name.c_str());
    mjs_setString(mesh->file, (folder / file).c_str());
    mjsBody* body = mjs_asBody(scene::find_in_spec(spec, mjOBJ_BODY, name, "meshes"));
    mjsGeom* geom = mjs_addGeom(body, nullptr);
    mjs_setName(geom->element, (name + "_mesh").c_str());
    geom->type = mjGEOM_MESH;
    geom->group = 2;
    geom->contype = geom->conaffinity = 0;
    geom->mass = 0;
    mjs_setString(geom->meshname, name.c_str());
    if (!cfg.material.empty()) mjs_setString(geom->material, (prefix + cfg.material).c_str());
  }
}

}  // namespace

std::function<void(mjSpec* spec, const std::string& prefix)> use_meshes(
    const MeshesCfg& cfg, const std::string& robot_file) {
  fs::path folder;
  std::string who = "meshes.folder";
  const char* named = cfg.env.empty() ? nullptr : std::getenv(cfg.env.c_str());
  if (named) {
    if (!*named) return {};  // set but empty: no meshes
    folder = named;
    who = cfg.env;
  } else if (!cfg.folder.empty()) {
    folder = fs::path(robot_file).parent_path() / cfg.folder;
    if (!fs::is_directory(folder)) return {};
  } else {
    return {};
  }
  for (const auto& [body, file] : cfg.files) {
    if (fs::is_regular_file(folder / file)) continue;
    throw ValueError(
        fmt::format("{}: '{}' is not a file; the folder must contain the {} meshes that {} "
                    "names",
                    who, (folder / file).string(), cfg.files.size(), robot_file));
  }
  return [cfg, folder](mjSpec* spec, const std::string& prefix) {
    replace(cfg, folder, spec, prefix);
  };
}

}  // namespace mjsense::tasks::robots
