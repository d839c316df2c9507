// SPDX-License-Identifier: Apache-2.0
#pragma once
// Attaches models to the scene's spec.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/scene/entity.h"
#include "mjsense/scene/initial_state.h"
#include "mjsense/scene/mj_spec.h"

namespace mjsense::scene {

// Parses the entity's model, names unnamed elements, and attaches it to `scene` with the prefix
// "<name>/". Throws ValueError that names the entity.
Attached attach_entity(mjSpec* scene, const std::string& name, const EntityCfg& cfg, Vfs& vfs,
                       std::vector<std::string>& warnings);

// Names unnamed elements by type and index: "geom_3". If the name exists already, "_" is appended.
void name_unnamed(mjSpec* spec);

// Prepares a complete model in place as the base to which entities are attached: names unnamed
// elements and takes out the keyframes.
Attached adopt_base(mjSpec* base, const ModelSource& source, Vfs& vfs);

}  // namespace mjsense::scene
