// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/initial_state.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {
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
  // `key`: the number of the scene's keyframe.
  Merger(const std::vector<Attached>& all, const Attached& entity, mjModel* model, int key)
      : all_(all),
        entity_(entity),
        m_(model),
        context_(fmt::format("entity '{}'", entity.name)),
        qpos_(m_->key_qpos + key * m_->nq),
        qvel_(m_->key_qvel + key * m_->nv),
        act_(m_->key_act + key * m_->na),
        ctrl_(m_->key_ctrl + key * m_->nu),
        mpos_(m_->key_mpos + 3 * key * m_->nmocap),
        mquat_(m_->key_mquat + 4 * key * m_->nmocap) {
    if (entity.name.empty()) context_ = "scene base";
  }

  // Null: the entity has no keyframe.
  void merge(const Keyframe* init) {
    Run qpos, qvel, ctrl, act, mocap;
    int free_joint = -1, mocap_root = -1;
    for (int j = 0; j < m_->njnt; ++j) {
      const std::string name = name_of(m_, mjOBJ_JOINT, j);
      if (!owns(name)) continue;
      const int type = m_->jnt_type[j];
      if (type == mjJNT_FREE) free_joint = j;
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
      const bool ours = entity_.has_mocap_base && name == entity_.name + "/mocap_base";
      if (m_->body_mocapid[b] < 0 || !owns(name) || ours) continue;
      if (mocap_root < 0) mocap_root = m_->body_mocapid[b];
      mocap.add(m_->body_mocapid[b], 1);
    }
    if (init) {
      put(init->qpos, qpos_, qpos, 1, "qpos");
      put(init->qvel, qvel_, qvel, 1, "qvel");
      put(init->ctrl, ctrl_, ctrl, 1, "ctrl");
      put(init->act, act_, act, 1, "act");
      put(init->mpos, mpos_, mocap, 3, "mpos");
      put(init->mquat, mquat_, mocap, 4, "mquat");
      if (entity_.name.empty()) return;
      if (free_joint >= 0) {
        mjtNum* q = qpos_ + m_->jnt_qposadr[free_joint];
        mjtNum* v = qvel_ + m_->jnt_dofadr[free_joint];  // linear: world axes, angular: the body's
        if (!init->qpos.empty()) move(q, q + 3);
        write_vec(rotate(entity_.moved.q, vec3(v)), v);
      } else if (mocap_root >= 0 && !init->mpos.empty() && !init->mquat.empty()) {
        move(mpos_ + 3 * mocap_root, mquat_ + 4 * mocap_root);
      }
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

  void move(mjtNum* pos, mjtNum* quaternion) const {
    const Pose& moved = entity_.moved;
    write_vec(moved * vec3(pos), pos);
    write_quat(moved.q * quat(quaternion), quaternion);
  }

  void put(const std::vector<double>& values, mjtNum* target, Run run, int width,
           const char* field) const {
    if (static_cast<int>(values.size()) > run.size * width) {
      throw ValueError(fmt::format("{}: its keyframe has {} of {}, but its model has {}", context_,
                                   counted(values.size(), "value"), field, run.size * width));
    }
    if (run.size > 0) std::copy(values.begin(), values.end(), target + run.start * width);
  }

  // Initial state of an entity without a keyframe: the configured pose, and joint_pos for hinge and
  // slide joints.
  void make() const {
    const EntityCfg& cfg = entity_.cfg;
    std::vector<Regex> patterns;
    for (const auto& [pattern, value] : cfg.joint_pos) {
      patterns.emplace_back(pattern, context_ + ": joint_pos");
    }
    std::vector<bool> used(patterns.size());
    for (int j = 0; j < m_->njnt; ++j) {
      const std::string name = name_of(m_, mjOBJ_JOINT, j);
      if (!owns(name)) continue;
      const int type = m_->jnt_type[j];
      mjtNum* q = qpos_ + m_->jnt_qposadr[j];
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
          entity_elements(m_, nullptr, entity_.name, mjOBJ_JOINT, context_).names;
      throw ValueError(fmt::format("{}: joint_pos: '{}' matches no hinge or slide{}", context_,
                                   pattern, suggest(pattern, names)));
    }
  }

  const std::vector<Attached>& all_;
  const Attached& entity_;
  mjModel* m_;
  std::string context_;
  mjtNum *qpos_, *qvel_, *act_, *ctrl_, *mpos_, *mquat_;
};

}  // namespace

std::vector<Keyframe> take_keyframes(mjSpec* spec) {
  std::vector<Keyframe> keys;
  for (mjsElement* element : spec_elements(spec, mjOBJ_KEY)) {
    const mjsKey* key = mjs_asKey(element);
    keys.push_back({element_name(element), key->time, values_of(key->qpos), values_of(key->qvel),
                    values_of(key->act), values_of(key->ctrl), values_of(key->mpos),
                    values_of(key->mquat)});
    mjs_delete(spec, element);
  }
  return keys;
}

void add_keyframes(mjSpec* spec, const std::vector<Keyframe>& base) {
  const auto add = [&](std::string_view name, double time) {
    mjsKey* key = mjs_addKey(spec);
    if (!name.empty()) mjs_setName(key->element, std::string(name).c_str());
    key->time = time;
  };
  for (const Keyframe& key : base) {
    if (key.name != kInitState) add(key.name, key.time);
  }
  add(kInitState, base.empty() ? 0.0 : base.front().time);
}

void merge_initial_states(const std::vector<Attached>& entities, mjModel* model) {
  const int init_state = mj_name2id(model, mjOBJ_KEY, kInitState.data());
  const auto merge = [&](int key, const Keyframe* of_base) {
    for (const Attached& entity : entities) {
      const Keyframe* first = entity.keys.empty() ? nullptr : &entity.keys.front();
      Merger(entities, entity, model, key).merge(entity.name.empty() ? of_base : first);
    }
  };
  for (const Attached& entity : entities) {
    if (!entity.name.empty()) continue;
    int number = 0;  // as add_keyframes() counts
    for (const Keyframe& key : entity.keys) {
      if (key.name != kInitState && number < init_state) merge(number++, &key);
    }
    if (init_state >= 0) merge(init_state, entity.keys.empty() ? nullptr : &entity.keys.front());
  }
}

}  // namespace mjsense::scene
