// SPDX-License-Identifier: Apache-2.0
#pragma once
// Settings of <compiler> that MuJoCo applies when it compiles a model as a whole. Most (angle,
// inertiafromgeom, boundmass, alignfree ...) stay with the elements of an attached model; these it
// drops.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/scene/spec.h"

namespace mjsense {

// Names of those that the model sets and that make a difference to it: settotalmass, fusestatic,
// discardvisual, fitaabb, lengthrange.
std::vector<std::string> whole_model_settings(const mjSpec* spec);

// The model as its own compilation makes it, in numbers, without such settings: attached, it is
// what it is alone. Named elements keep their names. Throws ValueError, or RuntimeError for what
// MJCF cannot say; both start with `place`.
SpecPtr apply_whole_model_settings(SpecPtr spec, const Vfs& vfs, std::string_view place);

}  // namespace mjsense
