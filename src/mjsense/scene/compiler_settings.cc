// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/compiler_settings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_call.h"

namespace mjsense::scene {
namespace {

bool is_muscle(const mjsActuator* actuator) {
  return actuator->gaintype == mjGAIN_MUSCLE || actuator->biastype == mjBIAS_MUSCLE;
}

bool has_fitted_geom(const mjSpec* spec) {
  const std::vector<mjsElement*> geoms = spec_elements(spec, mjOBJ_GEOM);
  return std::any_of(geoms.begin(), geoms.end(), [](mjsElement* element) {
    const mjsGeom* geom = mjs_asGeom(element);
    return geom->type != mjGEOM_MESH && geom->type != mjGEOM_SDF &&
           *mjs_getString(geom->meshname) != '\0';
  });
}

bool changes_length_ranges(const mjSpec* spec) {
  const mjLROpt& a = spec->compiler.LRopt;
  mjLROpt b;
  mj_defaultLROpt(&b);
  const bool same = a.mode == b.mode && a.useexisting == b.useexisting &&
                    a.uselimit == b.uselimit && a.accel == b.accel && a.maxforce == b.maxforce &&
                    a.timeconst == b.timeconst && a.timestep == b.timestep &&
                    a.inttotal == b.inttotal && a.interval == b.interval &&
                    a.tolrange == b.tolrange;
  return !same && mjs_firstElement(spec, mjOBJ_ACTUATOR) != nullptr;
}

// If a muscle has no length range, the scene would compute one.
void check_muscles_have_ranges(const mjSpec* spec, const mjModel* model, std::string_view context) {
  if (spec->compiler.LRopt.mode != mjLRMODE_NONE) return;
  for (mjsElement* element : spec_elements(spec, mjOBJ_ACTUATOR)) {
    const std::string name = element_name(element);
    const int id = mj_name2id(model, mjOBJ_ACTUATOR, name.c_str());
    const mjtNum* range = model->actuator_lengthrange + 2 * id;
    if (!is_muscle(mjs_asActuator(element)) || range[0] < range[1]) continue;
    throw ValueError(
        fmt::format("{}: <lengthrange mode='none'> leaves muscle '{}' without a range, which "
                    "cannot be kept for "
                    "one entity; give it a lengthrange, or leave out the mode",
                    context, name));
  }
}

}  // namespace

std::vector<std::string> whole_model_settings(const mjSpec* spec) {
  const mjsCompiler& compiler = spec->compiler;
  std::vector<std::string> names;
  if (compiler.settotalmass > 0) names.emplace_back("settotalmass");
  if (compiler.fusestatic) names.emplace_back("fusestatic");
  if (compiler.discardvisual) names.emplace_back("discardvisual");
  if (compiler.fitaabb && has_fitted_geom(spec)) names.emplace_back("fitaabb");
  if (changes_length_ranges(spec)) names.emplace_back("lengthrange");
  return names;
}

SpecPtr apply_whole_model_settings(SpecPtr spec, const Vfs& vfs, std::string_view context) {
  const std::string apart = fmt::format("{}: compiled by itself, because its <compiler> sets {}",
                                        context, fmt::join(whole_model_settings(spec.get()), ", "));
  const auto fail = [&](std::string_view why) {
    throw ValueError(fmt::format("{}: {}", apart, one_line(why)));
  };
  const ModelPtr model = compile(spec.get(), vfs);
  if (!model) fail(mjs_getError(spec.get()));
  check_muscles_have_ranges(spec.get(), model.get(), context);
  if (!mj_copyBack(spec.get(), model.get())) fail(mjs_getError(spec.get()));

  const std::string xml = save_compiled_xml(spec.get(), apart);
  char error[1024] = "";
  SpecPtr made(call_mujoco(mj_parseXMLString, xml.c_str(), vfs.get(), error, sizeof error));
  if (!made) fail(error);

  // Settings that do not belong to elements stay as written; the scene decides which of them to
  // use.
  made->option = spec->option;
  made->visual = spec->visual;
  made->stat = spec->stat;
  made->authored = spec->authored;
  made->memory = spec->memory;
  made->nuserdata = spec->nuserdata;
  made->njmax = spec->njmax;
  made->nconmax = spec->nconmax;
  made->nstack = spec->nstack;
  made->nkey = spec->nkey;
  // These bounds were already applied, before the total mass.
  made->compiler.boundmass = made->compiler.boundinertia = 0.0;
  return made;
}

}  // namespace mjsense::scene
