// SPDX-License-Identifier: Apache-2.0
#pragma once
// Settings of <compiler> that MuJoCo applies to a model as a whole. When a model is attached,
// MuJoCo keeps most settings (angle, inertiafromgeom, boundmass, alignfree ...) with its elements,
// but drops these.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/scene/mj_spec.h"

namespace mjsense::scene {

// Returns the names of the settings that the model sets and that affect it: settotalmass,
// fusestatic, discardvisual, fitaabb, lengthrange.
std::vector<std::string> whole_model_settings(const mjSpec* spec);

// Returns the model with the numbers that its own compilation computes and without such settings,
// so that it is the same whether attached or alone. Named elements keep their names. Throws
// ValueError, or RuntimeError for what MJCF cannot express; both start with `context`.
SpecPtr apply_whole_model_settings(SpecPtr spec, const Vfs& vfs, std::string_view context);

}  // namespace mjsense::scene
