// SPDX-License-Identifier: Apache-2.0
#pragma once
// Files that an entity's model refers to: meshes, height fields, textures, skins.

#include <mujoco/mujoco.h>

#include <string>

#include "mjsense/scene/entity.h"
#include "mjsense/scene/spec.h"

namespace mjsense {

// Gives every file of the parsed model a name that means the same wherever the spec is compiled or
// saved: an absolute path, or a file in `vfs` for what came in memory. Two entities may bring
// different files of one name: the later becomes
// "<entity>/<name>".
void adopt_assets(mjSpec* child, const ModelSource& source, const std::string& entity, Vfs& vfs);

}  // namespace mjsense
