// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/initial_state.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/match.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scene/spec.h"

namespace mjsense {
namespace {

std::vector<double> values_of(const mjDoubleVec* values) {
  int size = 0;
  const double* data = mjs_getDouble(values, &size);
  return {data, data + size};
}

// A range of a state vector. The elements of an entity are contiguous in the model.
struct Run {
  int start = -1, size = 0;
  void add(int adr, int n) {
    if (start < 0) start = adr;
    size += n;
  }
};

class Merger {
 public:
  Merger(const std::vector<Attached>& all, const Attached& entity, mjModel* model)
      : all_(all), entity_(entity), m_(model), place_(fmt::format("entity '{}'", entity.name)) {
    if (entity.name.empty()) place_ = "scene base";
  }

  void merge() {
    Run qpos, qvel, ctrl, act, mocap;
    for (int j = 0; j < m_->njnt; ++j) {
      const std::string name = name_of(m_, mjOBJ_JOINT, j);
      if (!owns(name)) continue;
      const int type = m_->jnt_type[j];
      qpos.add(m_->jnt_qposadr[j], type == mjJNT_FREE ? 7 : type == mjJNT_BALL ? 4 : 1);
      qvel.add(m_->jnt_dofadr[j], type == mjJNT_FREE ? 6 : type == mjJNT_BALL ? 3 : 1);
    }
    for (int a = 0; a < m_->nactuator; ++a) {
      if (!owns(name_of(m_, mjOBJ_ACTUATOR, a))) continue;
      ctrl.add(m_->actuator_ctrladr[a], m_->actuator_ctrlnum[a]);
      if (m_->actuator_actadr[a] >= 0) act.add(m_->actuator_actadr[a], m_->actuator_actnum[a]);
    }
    for (int b = 0; b < m_->nbody; ++b) {
      const std::string name = name_of(m_, mjOBJ_BODY, b);
      const bool ours = entity_.wrapped && name == entity_.name + "/mocap_base";
      if (m_->body_mocapid[b] >= 0 && owns(name) && !ours) mocap.add(m_->body_mocapid[b], 1);
    }
    const InitialState& init = entity_.init;
    if (init.from_xml) {
      put(init.qpos, m_->key_qpos, qpos, 1, "qpos");
      put(init.qvel, m_->key_qvel, qvel, 1, "qvel");
      put(init.ctrl, m_->key_ctrl, ctrl, 1, "ctrl");
      put(init.act, m_->key_act, act, 1, "act");
      put(init.mpos, m_->key_mpos, mocap, 3, "mpos");
      put(init.mquat, m_->key_mquat, mocap, 4, "mquat");
    } else if (!entity_.name.empty()) {
      make();
    }
  }

 private:
  bool owns(const std::string& name) const {
    if (!entity_.name.empty()) return name.starts_with(entity_.name + "/");
    return std::none_of(all_.begin(), all_.end(), [&](const Attached& other) {
      return !other.name.empty() && name.starts_with(other.name + "/");
    });
  }

  void put(const std::vector<double>& values, mjtNum* target, Run run, int width,
           const char* field) const {
    if (static_cast<int>(values.size()) > run.size * width) {
      throw ValueError(fmt::format("{}: its keyframe has {} values of {}, its model {}", place_,
                                   values.size(), field, run.size * width));
    }
    if (run.size > 0) std::copy(values.begin(), values.end(), target + run.start * width);
  }

  // Initial state of an entity without a keyframe: the configured pose, and joint_pos for hinge and
  // slide joints.
  void make() const {
    const EntityCfg& cfg = entity_.cfg;
    std::vector<Regex> patterns;
    for (const auto& [pattern, value] : cfg.joint_pos) {
      patterns.emplace_back(pattern, place_ + ": joint_pos");
    }
    std::vector<bool> used(patterns.size());
    for (int j = 0; j < m_->njnt; ++j) {
      const std::string name = name_of(m_, mjOBJ_JOINT, j);
      if (!owns(name)) continue;
      const int type = m_->jnt_type[j];
      mjtNum* q = m_->key_qpos + m_->jnt_qposadr[j];
      if (type == mjJNT_FREE) {
        std::copy(cfg.pos.begin(), cfg.pos.end(), q);
        std::copy(cfg.quat.begin(), cfg.quat.end(), q + 3);
        mju_normalize4(q + 3);
      } else if (type == mjJNT_HINGE || type == mjJNT_SLIDE) {
        q[0] = 0;
        for (std::size_t k = patterns.size(); k-- > 0;) {  // the first match wins
          if (!patterns[k].fullmatch(name.substr(entity_.name.size() + 1))) continue;
          q[0] = cfg.joint_pos[k].second;
          used[k] = true;
        }
      }
    }
    const auto unused = std::find(used.begin(), used.end(), false);
    if (unused != used.end()) {
      const std::string& pattern = patterns[unused - used.begin()].pattern();
      std::vector<std::string> names =
          entity_elements(m_, nullptr, entity_.name, mjOBJ_JOINT, place_).names;
      throw ValueError(fmt::format("{}: joint_pos: '{}' matches no hinge or slide{}", place_,
                                   pattern, suggest(pattern, names)));
    }
  }

  const std::vector<Attached>& all_;
  const Attached& entity_;
  mjModel* m_;
  std::string place_;
};

}  // namespace

InitialState take_keyframes(mjSpec* spec, const std::string& place,
                            std::vector<std::string>& warnings) {
  InitialState init;
  const std::vector<mjsElement*> keys = spec_elements(spec, mjOBJ_KEY);
  if (keys.size() > 1) {
    warnings.push_back(fmt::format("{}: {} keyframes; only the first, '{}', goes into init_state",
                                   place, keys.size(), element_name(keys[0])));
  }
  if (!keys.empty()) {
    const mjsKey* key = mjs_asKey(keys[0]);
    init = {true,
            values_of(key->qpos),
            values_of(key->qvel),
            values_of(key->act),
            values_of(key->ctrl),
            values_of(key->mpos),
            values_of(key->mquat)};
  }
  for (mjsElement* key : keys) mjs_delete(spec, key);
  return init;
}

void merge_initial_states(const std::vector<Attached>& entities, mjModel* model) {
  for (const Attached& entity : entities) Merger(entities, entity, model).merge();
}

}  // namespace mjsense
