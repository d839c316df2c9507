// SPDX-License-Identifier: Apache-2.0
#pragma once
// Files that an entity's model refers to: meshes, height fields, textures, skins.

#include <mujoco/mujoco.h>

#include <string>

#include "mjsense/scene/entity.h"
#include "mjsense/scene/mj_spec.h"

namespace mjsense::scene {

// Renames every file of the parsed model so that the name is valid wherever the spec is compiled or
// saved: an absolute path, or a file in `vfs` for files given in memory. If two entities have
// different files of the same name, the later one is renamed "<entity>/<name>".
void adopt_assets(mjSpec* child, const ModelSource& source, const std::string& entity, Vfs& vfs);

}  // namespace mjsense::scene
