// SPDX-License-Identifier: Apache-2.0
#pragma once
// The keyframe init_state: the first keyframes of all entities, joined.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/scene/entity.h"

namespace mjsense {

// One entity's part; vectors as its XML has them, possibly shorter than the entity.
struct InitialState {
  bool from_xml = false;
  std::vector<double> qpos, qvel, act, ctrl, mpos, mquat;
};

struct Attached {
  std::string name;  // "" for the scene's base: elements without a prefix
  EntityCfg cfg;
  bool fixed_base = false;
  bool wrapped = false;  // under "<name>/mocap_base"
  InitialState init;
};

// Keeps the first keyframe aside and removes all: MuJoCo would make each a keyframe of the whole
// scene. `place` starts the warning about further ones.
InitialState take_keyframes(mjSpec* spec, const std::string& place,
                            std::vector<std::string>& warnings);

// Fills the model's keyframe 0, which is at the model's defaults so far.
void merge_initial_states(const std::vector<Attached>& entities, mjModel* model);

}  // namespace mjsense
