#pragma once
// Attaching one entity to the scene's spec.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/scene/entity.h"
#include "mjsense/scene/spec.h"

namespace mjsense {

// The entity's part of the keyframe init_state; vectors as its XML has them, possibly shorter than
// the entity.
struct InitialState {
  bool from_xml = false;
  std::vector<double> qpos, qvel, act, ctrl, mpos, mquat;
};

struct Attached {
  std::string name;
  EntityCfg cfg;
  bool fixed_base = false;
  bool wrapped = false;  // under "<name>/mocap_base"
  InitialState init;
};

// Parses the entity's model, names what is unnamed, and moves everything into `scene` under the
// prefix "<name>/". Throws ValueError that names the entity.
Attached attach_entity(mjSpec* scene, const std::string& name, const EntityCfg& cfg, Vfs& vfs,
                       std::vector<std::string>& warnings);

// Fills the model's keyframe 0 ("init_state", at the model's defaults so far) with the entities'
// initial states.
void merge_initial_states(const std::vector<Attached>& entities, mjModel* model);

}  // namespace mjsense
