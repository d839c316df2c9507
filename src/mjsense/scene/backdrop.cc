// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/backdrop.h"

#include <fmt/format.h>

#include <atomic>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/scene/model_parts.h"

namespace mjsense::scene {
namespace {

constexpr std::string_view kConverted[] = {".glb", ".gltf", ".obj"};
constexpr int kShownGroups = 3;  // groups 0 to 2

std::atomic<BackdropConverter> backdrop_converter = nullptr;

// The path of an MJCF file.
std::string mjcf_of(const std::string& path, const std::string& who) {
  for (std::string_view suffix : kConverted) {
    if (!path.ends_with(suffix)) continue;
    const BackdropConverter convert = backdrop_converter;
    if (!convert)
      throw ValueError(fmt::format(
          "{}: only the Python package converts {} files; convert it with mjsense assets convert",
          who, suffix));
    return convert(path);
  }
  if (path.ends_with(".xml") || path.ends_with(".mjcf")) return path;
  throw ValueError(fmt::format(
      "{}: only files of type .xml, .glb, .gltf and .obj are read as surroundings", who));
}

// Elements that would move, act or measure.
void check_elements(const mjSpec* spec, const std::string& who) {
  constexpr std::pair<mjtObj, const char*> kOthers[] = {
      {mjOBJ_JOINT, "joint"},   {mjOBJ_ACTUATOR, "actuator"}, {mjOBJ_TENDON, "tendon"},
      {mjOBJ_SENSOR, "sensor"}, {mjOBJ_EQUALITY, "equality"}, {mjOBJ_FLEX, "flex"},
      {mjOBJ_PLUGIN, "plugin"}};
  for (const auto& [type, name] : kOthers) {
    const std::size_t count = spec_elements(spec, type).size();
    if (count > 0)
      throw ValueError(
          fmt::format("{}: its model has {} of type {}: surroundings that are only seen "
                      "have geoms and lights only",
                      who, counted(count, "element"), name));
  }
}

}  // namespace

void set_backdrop_converter(BackdropConverter converter) { backdrop_converter = converter; }

EntityCfg backdrop_entity(const std::string& path) {
  const std::string who = fmt::format("backdrop '{}'", path);
  SpecPtr spec = compose_model({.path = mjcf_of(path, who)}, {}, who);
  check_elements(spec.get(), who);
  int shown = 0;
  for (mjsElement* element : spec_elements(spec.get(), mjOBJ_GEOM)) {
    mjsGeom* geom = mjs_asGeom(element);
    geom->contype = geom->conaffinity = 0;
    if (geom->group < kShownGroups) {
      ++shown;
    } else if (mjs_delete(spec.get(), element) != 0) {
      throw ValueError(fmt::format("{}: {}", who, one_line(mjs_getError(spec.get()))));
    }
  }
  if (shown == 0) throw ValueError(fmt::format("{}: has no geom that cameras show", who));
  EntityCfg out;
  out.model.owner = std::shared_ptr<const mjSpec>(std::move(spec));
  out.model.spec = out.model.owner.get();
  out.mocap_base = false;
  return out;
}

}  // namespace mjsense::scene
