// SPDX-License-Identifier: Apache-2.0
#pragma once
// The keyframe init_state, which joins the first keyframes of all entities.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/scene/entity.h"

namespace mjsense::scene {

inline constexpr std::string_view kInitState = "init_state";

// A keyframe of one model. Vectors are as in its XML and may be shorter than the model needs.
struct Keyframe {
  std::string name;
  double time = 0;  // s
  std::vector<double> qpos, qvel, act, ctrl, mpos, mquat;
};

struct Attached {
  std::string name;  // "" for the scene's base, whose elements have no prefix
  EntityCfg cfg;
  bool fixed_base = false;
  bool has_mocap_base = false;  // attached below "<name>/mocap_base"
  std::vector<Keyframe> keys;   // at most one of an entity
  // Transform from the root's pose in the entity's own model to its pose in the scene, also applied
  // to the root's pose in keyframes.
  Pose moved{};
};

// Removes and returns the keyframes of a spec, because attaching it with MuJoCo would make each of
// them a keyframe of the whole scene.
std::vector<Keyframe> take_keyframes(mjSpec* spec);

// Adds the scene's keyframes to the spec with names and times only; `base` holds those of the base.
// The scene's init_state replaces a keyframe of the base with that name.
void add_keyframes(mjSpec* spec, const std::vector<Keyframe>& base);

// Fills the keyframes of the compiled model, which must still have the model's defaults.
void merge_initial_states(const std::vector<Attached>& entities, mjModel* model);

}  // namespace mjsense::scene
