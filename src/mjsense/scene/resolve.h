// SPDX-License-Identifier: Apache-2.0
#pragma once
// Resolves names of MuJoCo elements to ids, for sensors. `context` is the prefix of error messages:
// "sensor 'imu'".

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/scene/entity.h"

namespace mjsense::scene {

class Scene;

// "body" -> mjOBJ_BODY ...; throws ValueError with the known types.
mjtObj obj_type(std::string_view name, std::string_view context);
std::string obj_type_name(mjtObj type);

// Names of all elements of a type in model order; "" for unnamed ones. XBODY is treated as BODY.
std::vector<std::string> model_names(const mjModel* model, mjtObj type);
std::string name_of(const mjModel* model, mjtObj type, int id);  // full name, "" if unnamed

// Returns the id of the element with this full name. Throws KeyError with the place and the nearest
// names.
int resolve(const mjModel* model, mjtObj type, std::string_view full_name,
            std::string_view context);

struct ResolvedObj {
  mjtObj type = mjOBJ_UNKNOWN;
  int id = -1;
};

// Also throws KeyError for an unknown entity, with the names of the entities (not checked if
// `scene` is null).
ResolvedObj resolve(const mjModel* model, const Scene* scene, const ObjRef& ref,
                    std::string_view context);

// Local names and ids of an entity's elements, in model order. With "" as the entity: all elements,
// with full names. The world body belongs to no entity. Throws KeyError for an unknown entity.
struct Elements {
  std::vector<std::string> names;
  std::vector<int> ids;
};
Elements entity_elements(const mjModel* model, const Scene* scene, std::string_view entity,
                         mjtObj type, std::string_view context);

}  // namespace mjsense::scene
