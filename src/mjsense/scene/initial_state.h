// SPDX-License-Identifier: Apache-2.0
#pragma once
// The keyframe init_state, which joins the first keyframes of all entities.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/scene/entity.h"

namespace mjsense {

// Initial state of one entity. Vectors are as in its XML and may be shorter than the entity needs.
struct InitialState {
  bool from_xml = false;
  std::vector<double> qpos, qvel, act, ctrl, mpos, mquat;
};

struct Attached {
  std::string name;  // "" for the scene's base, whose elements have no prefix
  EntityCfg cfg;
  bool fixed_base = false;
  bool wrapped = false;  // attached below "<name>/mocap_base"
  InitialState init;
};

// Returns the first keyframe and removes all, because MuJoCo would make each a keyframe of the
// whole scene. `place` is the prefix of the warning about further keyframes.
InitialState take_keyframes(mjSpec* spec, const std::string& place,
                            std::vector<std::string>& warnings);

// Fills the model's keyframe 0, which must still have the model's defaults.
void merge_initial_states(const std::vector<Attached>& entities, mjModel* model);

}  // namespace mjsense
