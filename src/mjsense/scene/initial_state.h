// SPDX-License-Identifier: Apache-2.0
#pragma once
// The scene's keyframes: those of the base, each joined with the first keyframes of the entities, then
// init_state, which joins the first keyframes of all.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/scene/entity.h"

namespace mjsense {

inline constexpr std::string_view kInitState = "init_state";

// A keyframe of one model; vectors as its XML has them, possibly shorter than the model.
struct Keyframe {
  std::string name;
  double time = 0;  // s
  std::vector<double> qpos, qvel, act, ctrl, mpos, mquat;
};

struct Attached {
  std::string name;  // "" for the scene's base: elements without a prefix
  EntityCfg cfg;
  bool fixed_base = false;
  bool wrapped = false;        // under "<name>/mocap_base"
  std::vector<Keyframe> keys;  // at most one of an entity
  // From the root's pose in the entity's own model to its pose in the scene: a keyframe's pose of the
  // root is moved along.
  Pose moved{};
};

// Removes a spec's keyframes and returns them: MuJoCo would make each a keyframe of the whole scene.
std::vector<Keyframe> take_keyframes(mjSpec* spec);

// Adds the scene's keyframes to the spec, empty but for their names and times; `base` holds those of
// the base. A keyframe of the base that is called init_state gives its place to the scene's.
void add_keyframes(mjSpec* spec, const std::vector<Keyframe>& base);

// Fills them in the compiled model, in which they are at the model's defaults.
void merge_initial_states(const std::vector<Attached>& entities, mjModel* model);

}  // namespace mjsense
