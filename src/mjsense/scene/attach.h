// SPDX-License-Identifier: Apache-2.0
#pragma once
// Attaching models to the scene's spec.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/scene/entity.h"
#include "mjsense/scene/initial_state.h"
#include "mjsense/scene/spec.h"

namespace mjsense {

// Parses the entity's model, names what is unnamed, and moves everything into `scene` under the
// prefix "<name>/". Throws ValueError that names the entity.
Attached attach_entity(mjSpec* scene, const std::string& name, const EntityCfg& cfg, Vfs& vfs,
                       std::vector<std::string>& warnings);

// Makes a whole model the ground that entities are attached to, in place: names what is unnamed,
// takes its keyframes out.
Attached adopt_base(mjSpec* base, const ModelSource& source, Vfs& vfs);

}  // namespace mjsense
