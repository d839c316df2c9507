// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/scene/compiler_settings.h"
#include "mjsense/scene/initial_state.h"
#include "mjsense/scene/model_assets.h"
#include "mjsense/scene/mujoco_log.h"

namespace mjsense::scene {
namespace {

template <class Element>
void copy_pose(const Element* from, mjsFrame* to) {
  std::copy_n(from->pos, 3, to->pos);
  std::copy_n(from->quat, 4, to->quat);
  to->alt = from->alt;
}

// Creates the frame at which the part is attached: that of the site, or of the body.
mjsFrame* mount(mjSpec* model, const std::string& name, const std::string& context) {
  if (mjsElement* element = mjs_findElement(model, mjOBJ_SITE, name.c_str())) {
    mjsFrame* frame = mjs_addFrame(mjs_getParent(element), mjs_getFrame(element));
    copy_pose(mjs_asSite(element), frame);
    return frame;
  }
  if (mjsBody* body = mjs_findBody(model, name.c_str())) return mjs_addFrame(body, nullptr);
  std::vector<std::string> names = spec_names(model, mjOBJ_SITE);
  const std::vector<std::string> bodies = spec_names(model, mjOBJ_BODY);
  names.insert(names.end(), bodies.begin(), bodies.end());
  throw_unknown(context, "site or body", name, names);
}

// Elements whose names must differ within a model.
constexpr std::pair<mjtObj, const char*> kNamed[] = {
    {mjOBJ_BODY, "body"},         {mjOBJ_JOINT, "joint"},   {mjOBJ_GEOM, "geom"},
    {mjOBJ_SITE, "site"},         {mjOBJ_CAMERA, "camera"}, {mjOBJ_LIGHT, "light"},
    {mjOBJ_ACTUATOR, "actuator"}, {mjOBJ_SENSOR, "sensor"}, {mjOBJ_TENDON, "tendon"}};

// A prefix with which the name is not taken: "gripper/" for gripper.xml.
std::string free_prefix(const std::vector<std::string>& taken, const ModelPart& part,
                        const std::string& name) {
  const std::string stem = std::filesystem::path(part.path).stem().string();
  for (int k = 1;; ++k) {
    const std::string prefix = k == 1 ? stem : fmt::format("{}{}", stem, k);
    if (std::ranges::find(taken, prefix + "/" + name) == taken.end()) return prefix;
  }
}

// Throws ValueError if the model has an element with the name that one of the part would have.
void check_names(const mjSpec* model, const mjSpec* child, const ModelPart& part,
                 const std::string& context) {
  for (const auto& [type, what] : kNamed) {
    const std::vector<std::string> taken = spec_names(model, type);
    for (const std::string& name : spec_names(child, type)) {
      const std::string full = part.prefix + name;
      if (name.empty() || (type == mjOBJ_BODY && name == "world") ||
          std::ranges::find(taken, full) == taken.end())
        continue;
      throw ValueError(
          fmt::format("{}: its {} '{}' has the name of a {} of the models before it; its prefix is "
                      "'{}': write another one, for example prefix = \"{}/\"",
                      context, what, full, what, part.prefix, free_prefix(taken, part, name)));
    }
  }
}

void attach_part(mjSpec* model, const ModelPart& part, std::string_view of) {
  const std::string context = fmt::format("{}: part '{}'", of, part.path);
  Vfs vfs;
  const ModelSource source{.path = part.path};
  SpecPtr child = parse_model(source, context);
  adopt_assets(child.get(), source, "", vfs);
  take_keyframes(child.get());
  if (!whole_model_settings(child.get()).empty())
    child = apply_whole_model_settings(std::move(child), vfs, context);
  mj_defaultOption(&child->option);
  child->authored.option = 0;
  child->authored.disableflags = child->authored.enableflags = child->authored.disableactuator = 0;

  check_names(model, child.get(), part, context);
  mjsFrame* at = mount(model, part.attach_to, context);
  mjsFrame* frame = mjs_addFrame(mjs_getParent(at->element), at);
  std::copy(part.pos.begin(), part.pos.end(), frame->pos);
  std::copy(part.quat.begin(), part.quat.end(), frame->quat);
  // The attached part is referenced, so the model keeps its spec alive.
  if (!call_mujoco(mjs_attach, frame->element, child->element, part.prefix.c_str(), ""))
    throw ValueError(fmt::format("{}: {}", context, one_line(mjs_getError(model))));
}

}  // namespace

SpecPtr compose_model(const ModelSource& model, std::span<const ModelPart> parts,
                      std::string_view context) {
  SpecPtr spec = parse_model(model, context);
  Vfs vfs;
  adopt_assets(spec.get(), model, "", vfs);
  // MuJoCo warns that a part without a prefix may be saved incorrectly; save_xml() handles this
  // case.
  std::vector<std::string> warnings;
  const WarningCapture capture(warnings);
  if (!parts.empty()) take_keyframes(spec.get());
  for (const ModelPart& part : parts) attach_part(spec.get(), part, context);
  return spec;
}

}  // namespace mjsense::scene
