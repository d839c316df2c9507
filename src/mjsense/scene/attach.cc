// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/attach.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scene/compiler_settings.h"
#include "mjsense/scene/model_assets.h"
#include "mjsense/scene/physics_options.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {
namespace {

constexpr const char* kFreeJoint = "floating_base_joint";

std::string context_of(const std::string& name) { return fmt::format("entity '{}'", name); }

void drop_options(mjSpec* spec, const std::string& context, std::vector<std::string>& warnings) {
  mjOption standard;
  mj_defaultOption(&standard);
  const std::vector<std::string> changed = differing_options(spec->option, standard);
  if (!changed.empty()) {
    warnings.push_back(
        fmt::format("{}: its <option> is not carried over ({}); set the scene's options", context,
                    fmt::join(changed, ", ")));
  }
  spec->option = standard;
  spec->authored.option = 0;
  spec->authored.disableflags = spec->authored.enableflags = spec->authored.disableactuator = 0;
}

// Each group of <visual> settings is taken from the first entity that sets it.
void move_visual(mjSpec* from, mjSpec* to) {
  const auto move = [](std::uint64_t& mine, std::uint64_t& theirs, const auto& value,
                       auto& target) {
    if (theirs == 0 && mine != 0) {
      target = value;
      theirs = mine;
    }
    mine = 0;
  };
  mjsAuthored& a = from->authored;
  mjsAuthored& b = to->authored;
  move(a.visual_global, b.visual_global, from->visual.global, to->visual.global);
  move(a.visual_quality, b.visual_quality, from->visual.quality, to->visual.quality);
  move(a.visual_headlight, b.visual_headlight, from->visual.headlight, to->visual.headlight);
  move(a.visual_map, b.visual_map, from->visual.map, to->visual.map);
  move(a.visual_scale, b.visual_scale, from->visual.scale, to->visual.scale);
  move(a.visual_rgba, b.visual_rgba, from->visual.rgba, to->visual.rgba);
  from->visual = to->visual;
}

bool any_mocap(const mjSpec* spec) {
  const std::vector<mjsElement*> bodies = spec_elements(spec, mjOBJ_BODY);
  return std::any_of(bodies.begin(), bodies.end(),
                     [](mjsElement* body) { return mjs_asBody(body)->mocap; });
}

bool is_identity(const EntityCfg& cfg) {
  return cfg.pos == std::array<double, 3>{0, 0, 0} && cfg.quat == std::array<double, 4>{1, 0, 0, 0};
}

// Elements that refer to others. MuJoCo silently drops those whose target is unknown.
struct ElementNames {
  mjtObj type;
  std::vector<std::string> names;
};

std::vector<ElementNames> element_names_of(const mjSpec* spec) {
  std::vector<ElementNames> counts;
  for (mjtObj type :
       {mjOBJ_ACTUATOR, mjOBJ_SENSOR, mjOBJ_TENDON, mjOBJ_EQUALITY, mjOBJ_PAIR, mjOBJ_EXCLUDE}) {
    counts.push_back({type, spec_names(spec, type)});
  }
  return counts;
}

void check_nothing_lost(const std::vector<ElementNames>& child,
                        const std::vector<ElementNames>& before,
                        const std::vector<ElementNames>& after, const ModelSource& source,
                        const std::string& context) {
  for (std::size_t i = 0; i < child.size(); ++i) {
    const std::vector<std::string>& now = after[i].names;
    if (now.size() - before[i].names.size() == child[i].names.size()) continue;
    std::string why = explain_fault(source, context);  // MuJoCo's error for the model alone
    if (!why.empty()) throw ValueError(fmt::format("{}: {}", context, why));
    const auto lost = std::find_if(child[i].names.begin(), child[i].names.end(), [&](auto& name) {
      return std::none_of(now.begin(), now.end(), [&](auto& n) { return n.ends_with("/" + name); });
    });
    throw ValueError(fmt::format(
        "{}: its {} '{}' cannot be attached: it refers to an element outside its model", context,
        obj_type_name(child[i].type), lost == child[i].names.end() ? "" : *lost));
  }
}

double squared_norm(const std::array<double, 4>& quat) {
  double norm = 0;
  for (double q : quat) norm += q * q;
  return norm;
}

std::array<double, 4> unit_quat(const EntityCfg& cfg, const std::string& context) {
  check_fields(cfg, context);
  const double norm = squared_norm(cfg.quat);
  std::array<double, 4> unit;
  for (int i = 0; i < 4; ++i) unit[i] = cfg.quat[i] / std::sqrt(norm);
  return unit;
}

// The pose of a body or frame in what surrounds it.
template <class Element>
Pose pose_of(const Element* element, const mjSpec* spec, const std::string& context) {
  double q[4];
  std::copy(element->quat, element->quat + 4, q);
  if (element->alt.type != mjORIENTATION_QUAT) {
    const char* fault =
        mjs_resolveOrientation(q, spec->compiler.degree, spec->compiler.eulerseq, &element->alt);
    if (fault) throw ValueError(fmt::format("{}: {}", context, fault));
  }
  return {vec3(element->pos), normalized(quat(q))};
}

// Sets the configured pose of a root body. Returns the displacement from its previous pose, world
// frame.
Pose set_pose(mjsBody* body, const EntityCfg& cfg, const mjSpec* spec, const std::string& context) {
  const std::array<double, 4> q = unit_quat(cfg, context);
  if (is_identity(cfg)) return {};
  Pose frames;  // product of the frames that contain the body
  for (mjsFrame* f = mjs_getFrame(body->element); f; f = mjs_getFrame(f->element))
    frames = pose_of(f, spec, context) * frames;
  const Pose before = frames * pose_of(body, spec, context);
  const Pose wanted{vec3(cfg.pos.data()), quat(q.data())};
  const Pose local = mjs_getFrame(body->element) ? inverse(frames) * wanted : wanted;
  write_vec(local.p, body->pos);
  write_quat(local.q, body->quat);
  mjs_defaultOrientation(&body->alt);
  return wanted * inverse(before);
}

}  // namespace

void validate(const EntityCfg& cfg, std::string_view context) {
  if (!(squared_norm(cfg.quat) > 1e-12)) {
    throw ValueError(fmt::format("{}: quat ({}) is not a rotation; expected w, x, y, z", context,
                                 fmt::join(cfg.quat, ", ")));
  }
  for (const auto& [pattern, value] : cfg.joint_pos)
    Regex(pattern, fmt::format("{}: joint_pos", context));
}

Attached attach_entity(mjSpec* scene, const std::string& name, const EntityCfg& cfg, Vfs& vfs,
                       std::vector<std::string>& warnings) {
  const std::string context = context_of(name);
  SpecPtr child = parse_model(cfg.model, context);
  adopt_assets(child.get(), cfg.model, name, vfs);
  name_unnamed(child.get());

  Attached attached{name, cfg};
  attached.keys = take_keyframes(child.get());
  if (attached.keys.size() > 1) {
    warnings.push_back(fmt::format("{}: {} keyframes; only the first, '{}', goes into init_state",
                                   context, attached.keys.size(), attached.keys.front().name));
    attached.keys.resize(1);
  }
  if (!whole_model_settings(child.get()).empty()) {
    child = apply_whole_model_settings(std::move(child), vfs, context);
  }
  std::vector<mjsElement*> free_joints;
  for (mjsElement* joint : spec_elements(child.get(), mjOBJ_JOINT)) {
    if (mjs_asJoint(joint)->type == mjJNT_FREE) free_joints.push_back(joint);
  }
  if (free_joints.size() > 1) {
    throw ValueError(fmt::format(
        "{}: its model has {} freejoints ('{}', '{}', ...); an entity has at most one; make each "
        "floating part an entity, or the whole model the scene's base",
        context, free_joints.size(), element_name(free_joints[0]), element_name(free_joints[1])));
  }
  attached.fixed_base = free_joints.empty();
  drop_options(child.get(), context, warnings);
  move_visual(child.get(), scene);

  mjsBody* world = mjs_findBody(scene, "world");
  mjsElement* root = mjs_firstChild(mjs_findBody(child.get(), "world"), mjOBJ_BODY, 0);
  const bool is_mocap = root && mjs_asBody(root)->mocap;
  const bool has_mocap = any_mocap(child.get());
  attached.has_mocap_base = attached.fixed_base && !has_mocap && cfg.mocap_base;
  if (attached.fixed_base && has_mocap && !is_mocap && cfg.mocap_base) {
    warnings.push_back(fmt::format(
        "{}: stays on the world body, because MuJoCo does not nest its mocap bodies", context));
  }
  mjsBody* parent = world;
  if (attached.has_mocap_base) {
    parent = mjs_addBody(world, nullptr);
    mjs_setName(parent->element, (name + "/mocap_base").c_str());
    parent->mocap = 1;
    set_pose(parent, cfg, scene, context);
  } else if (!attached.fixed_base) {
    attached.moved = set_pose(mjs_getParent(free_joints[0]), cfg, child.get(), context);
  } else if (is_mocap) {
    attached.moved = set_pose(mjs_asBody(root), cfg, child.get(), context);
  }
  mjsFrame* frame = mjs_addFrame(parent, nullptr);
  if (attached.fixed_base && !attached.has_mocap_base && !is_mocap) {
    const std::array<double, 4> quat = unit_quat(cfg, context);
    std::copy(cfg.pos.begin(), cfg.pos.end(), frame->pos);
    std::copy(quat.begin(), quat.end(), frame->quat);
  }
  const std::vector<ElementNames> before = element_names_of(child.get()),
                                  scene_before = element_names_of(scene);
  // The attached model is referenced, so the scene keeps the child spec alive.
  if (!call_mujoco(mjs_attach, frame->element, child->element, (name + "/").c_str(), "")) {
    throw ValueError(fmt::format("{}: {}", context, one_line(mjs_getError(scene))));
  }
  check_nothing_lost(before, scene_before, element_names_of(scene), cfg.model, context);
  return attached;
}

void name_unnamed(mjSpec* spec) {
  for (mjtObj type : {mjOBJ_BODY, mjOBJ_JOINT, mjOBJ_GEOM, mjOBJ_SITE, mjOBJ_CAMERA, mjOBJ_LIGHT,
                      mjOBJ_TENDON, mjOBJ_ACTUATOR, mjOBJ_SENSOR}) {
    const std::vector<mjsElement*> elements = spec_elements(spec, type);
    const std::vector<std::string> names = spec_names(spec, type);
    std::set<std::string> taken(names.begin(), names.end());
    for (std::size_t i = 0; i < elements.size(); ++i) {
      if (!names[i].empty()) continue;
      std::string name = fmt::format("{}_{}", obj_type_name(type), i);
      if (type == mjOBJ_JOINT && mjs_asJoint(elements[i])->type == mjJNT_FREE) name = kFreeJoint;
      while (!taken.insert(name).second) name += "_";
      mjs_setName(elements[i], name.c_str());
    }
  }
}

Attached adopt_base(mjSpec* base, const ModelSource& source, Vfs& vfs) {
  adopt_assets(base, source, "", vfs);
  name_unnamed(base);
  Attached attached;
  attached.keys = take_keyframes(base);
  return attached;
}

}  // namespace mjsense::scene
