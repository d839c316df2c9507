// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/resolve.h"

#include <fmt/format.h>

#include <utility>

#include "mjsense/core/element_count.h"
#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense/scene/scene.h"

namespace mjsense::scene {
namespace {

void check_entity(const Scene* scene, std::string_view entity, std::string_view context) {
  if (!scene || entity.empty()) return;
  find_named(scene->entities(), &Entity::name, entity, context, "entity");
}

}  // namespace

mjtObj obj_type(std::string_view name, std::string_view context) {
  if (const int type = mju_str2Type(std::string(name).c_str()); type > 0)
    return static_cast<mjtObj>(type);
  std::vector<std::string> known;
  for (int type = 1; type < mjNOBJECT; ++type) {
    if (const char* word = mju_type2Str(type)) known.emplace_back(word);
  }
  const bool near = !nearest_names(name, known, 1).empty();
  throw ValueError(fmt::format(
      "{}: unknown object type '{}'; known: body, xbody, joint, geom, site, camera, light, tendon, "
      "actuator, sensor, mesh, hfield, ...{}",
      context, name, near ? suggest(name, known) : ""));
}

std::string obj_type_name(mjtObj type) {
  const char* name = mju_type2Str(type);
  return name ? name : "object";
}

std::string name_of(const mjModel* model, mjtObj type, int id) {
  const char* name = mj_id2name(model, type, id);
  return name ? name : "";
}

std::vector<std::string> model_names(const mjModel* model, mjtObj type) {
  if (type == mjOBJ_XBODY) type = mjOBJ_BODY;
  std::vector<std::string> names;
  const int count = count_of(model, type);
  for (int i = 0; i < count; ++i) names.push_back(name_of(model, type, i));
  return names;
}

int resolve(const mjModel* model, mjtObj type, std::string_view full_name,
            std::string_view context) {
  const std::string name(full_name);
  const int id =
      name.empty() ? -1 : mj_name2id(model, type == mjOBJ_XBODY ? mjOBJ_BODY : type, name.c_str());
  if (id < 0) throw_unknown(context, obj_type_name(type), name, model_names(model, type));
  return id;
}

ResolvedObj resolve(const mjModel* model, const Scene* scene, const ObjRef& ref,
                    std::string_view context) {
  check_entity(scene, ref.entity, context);
  const mjtObj type = obj_type(ref.type, context);
  return {type, resolve(model, type, ref.full_name(), context)};
}

Elements entity_elements(const mjModel* model, const Scene* scene, std::string_view entity,
                         mjtObj type, std::string_view context) {
  check_entity(scene, entity, context);
  // The terrain is attached without a prefix; its elements are named "terrain..." without a slash.
  const std::string prefix = entity.empty() ? "" : fmt::format("{}/", entity);
  Elements found;
  const std::vector<std::string> names = model_names(model, type);
  const bool bodies = type == mjOBJ_BODY || type == mjOBJ_XBODY;
  for (int i = bodies && !entity.empty() ? 1 : 0; i < static_cast<int>(names.size()); ++i) {
    const std::string& name = names[i];
    if (name.starts_with(prefix)) {
      found.names.push_back(name.substr(prefix.size()));
      found.ids.push_back(i);
    } else if (entity == "terrain" && name.starts_with("terrain") &&
               name.find('/') == std::string::npos) {
      found.names.push_back(name);
      found.ids.push_back(i);
    }
  }
  return found;
}

}  // namespace mjsense::scene
