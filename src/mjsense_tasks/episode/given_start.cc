// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/given_start.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/mujoco_objects.h"

namespace mjsense::tasks::episode {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kSamePlace = 1e-3, kSameTurn = 1e-2;  // m, rad, of bodies that cannot be moved

[[noreturn]] void refuse(const std::string& number, std::string_view key, std::string_view wanted) {
  throw ValueError(fmt::format("starts: '{}' of episode {} must be {}", key, number, wanted));
}

std::vector<double> numbers(const Json& value, const std::string& number, std::string_view key,
                            std::size_t count = 0) {
  const auto is_finite = [](const Json& x) {
    return x.is_number() && std::isfinite(x.get<double>());
  };
  if (!value.is_array() || (count > 0 && value.size() != count) ||
      !std::ranges::all_of(value, is_finite))
    refuse(number, key,
           count > 0 ? fmt::format("{} finite numbers", count) : "a list of finite numbers");
  return value.get<std::vector<double>>();
}

Pose pose(const Json& value, const std::string& number, std::string_view key) {
  const std::vector<double> v = numbers(value, number, key, 7);
  const Quat q = quat(v.data() + 3);
  if (!(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z > 1e-12))
    refuse(number, key, "a pose whose quaternion is not 0");
  return {vec3(v.data()), q};
}

std::string text(const Json& value, const std::string& number, std::string_view key) {
  if (!value.is_string()) refuse(number, key, "a text");
  return value.get<std::string>();
}

GivenStart read_start(const Json& from, const std::string& number) {
  GivenStart out;
  if (!from.is_object()) throw ValueError(fmt::format("starts: {} must be an object", number));
  const auto members = [&](const Json& value, const std::string& key) {
    if (!value.is_object()) refuse(number, key, "an object");
    return value.items();
  };
  for (const auto& [key, value] : from.items()) {
    if (key == "bodies") {
      for (const auto& [name, at] : members(value, key)) out.bodies[name] = pose(at, number, name);
    } else if (key == "absent") {
      if (!value.is_array()) refuse(number, key, "a list");
      for (const Json& name : value) out.absent.push_back(text(name, number, key));
    } else if (key == "joints") {
      for (const auto& [name, at] : members(value, key))
        out.joints[name] = numbers(Json::array({at}), number, name, 1)[0];
    } else if (key == "thresholds") {
      for (const auto& [name, at] : members(value, key))
        out.thresholds[name] = numbers(Json::array({at}), number, name, 1)[0];
    } else if (key == "robot") {
      for (const auto& [name, at] : members(value, key))
        out.robot[name] = numbers(at, number, name);
    } else if (key == "base") {
      out.base = pose(value, number, key);
    } else if (key == "objects") {
      for (const auto& [role, body] : members(value, key))
        out.objects[role] = text(body, number, role);
    } else if (key == "instruction") {
      out.instruction = text(value, number, key);
    } else if (key == "cameras") {
      out.cameras = value.dump();
    } else {
      throw ValueError(fmt::format("starts: episode {} has the unknown member '{}'", number, key));
    }
  }
  return out;
}

bool is_free(const mjModel* m, int body) {
  return m->body_jntnum[body] == 1 && m->jnt_type[m->body_jntadr[body]] == mjJNT_FREE;
}

bool is_scalar(const mjModel* m, int joint) {
  return m->jnt_type[joint] == mjJNT_HINGE || m->jnt_type[joint] == mjJNT_SLIDE;
}

}  // namespace

GivenStarts read_starts(std::string_view json) {
  GivenStarts starts;
  const Json all = Json::parse(json, nullptr, /*allow_exceptions=*/false);
  if (!all.is_object()) throw ValueError("starts: must be a JSON object of starts by number");
  for (const auto& [number, start] : all.items()) {
    if (number.empty() || number.size() > 9 ||
        number.find_first_not_of("0123456789") != number.npos)
      throw ValueError(fmt::format("starts: '{}' is not the number of an episode", number));
    starts[std::stoll(number)] = read_start(start, number);
  }
  return starts;
}

int find_name(const mjModel* model, mjtObj type, std::string_view name) {
  const std::string exact(name);
  if (const int id = mj_name2id(model, type, exact.c_str()); id >= 0) return id;
  const bool is_body = type == mjOBJ_BODY;
  const int count = static_cast<int>(is_body ? model->nbody : model->njnt);
  const int* addresses = is_body ? model->name_bodyadr : model->name_jntadr;
  int found = -1;
  for (int i = 0; i < count; ++i) {
    if (!std::string_view(model->names + addresses[i]).ends_with("/" + exact)) continue;
    if (found >= 0) return -1;
    found = i;
  }
  return found;
}

void check_names(const mjModel* model, const GivenStarts& starts, std::string_view context) {
  std::set<std::string> missing, fixed;
  const DataPtr data = make_data(model);
  mj_kinematics(model, data.get());
  const auto body = [&](const std::string& name) {
    const int id = find_name(model, mjOBJ_BODY, name);
    if (id < 0) missing.insert(name);
    return id;
  };
  for (const auto& [number, start] : starts) {
    for (const auto& [name, at] : start.bodies) {
      const int id = body(name);
      if (id < 0 || is_free(model, id)) continue;
      const Pose here = body_pose(data.get(), id);
      if (norm(here.p - at.p) > kSamePlace || angle_between(here.q, normalized(at.q)) > kSameTurn)
        fixed.insert(name);
    }
    for (const std::string& name : start.absent) {
      const int id = find_name(model, mjOBJ_BODY, name);
      if (id >= 0 && !is_free(model, id)) fixed.insert(name);
    }
    for (const auto& [role, name] : start.objects) body(name);
    for (const auto& [name, at] : start.joints) {
      const int id = find_name(model, mjOBJ_JOINT, name);
      if (id < 0) missing.insert(name);
      if (id >= 0 && !is_scalar(model, id)) fixed.insert(name);
    }
  }
  std::vector<std::string> faults;
  if (!missing.empty()) {
    std::vector<std::string> known;
    for (int i = 1; i < model->nbody; ++i) {
      if (is_free(model, i)) known.emplace_back(model->names + model->name_bodyadr[i]);
    }
    faults.push_back(fmt::format("the scene has no '{}'; its free bodies are '{}'",
                                 fmt::join(missing, "', '"), fmt::join(known, "', '")));
  }
  if (!fixed.empty())
    faults.push_back(
        fmt::format("'{}' cannot be moved: it has no free joint of its own, hinge or slide",
                    fmt::join(fixed, "', '")));
  if (!faults.empty())
    throw ValueError(fmt::format("{}: given starts: {}", context, fmt::join(faults, "; ")));
}

void write_start(const mjModel* model, const GivenStart& start, const robots::StateRow& state) {
  for (const auto& [name, at] : start.bodies) {
    const int body = find_name(model, mjOBJ_BODY, name);
    if (!is_free(model, body)) continue;
    const int joint = model->body_jntadr[body];
    write_vec(at.p, state.qpos + model->jnt_qposadr[joint]);
    write_quat(at.q, state.qpos + model->jnt_qposadr[joint] + 3);
    std::fill_n(state.qvel + model->jnt_dofadr[joint], 6, 0.0);
  }
  for (const auto& [name, at] : start.joints) {
    const int joint = find_name(model, mjOBJ_JOINT, name);
    state.qpos[model->jnt_qposadr[joint]] = at;
    state.qvel[model->jnt_dofadr[joint]] = 0;
  }
}

}  // namespace mjsense::tasks::episode
