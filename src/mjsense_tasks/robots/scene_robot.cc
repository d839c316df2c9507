// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/scene_robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "mjsense/core/element_count.h"
#include "mjsense/core/error.h"
#include "mjsense/core/text/name_matching.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::robots {
namespace {

// The elements of one type whose names begin with the prefix: local names and ids.
struct Named {
  std::vector<std::string> names;
  std::vector<int> ids;
};

Named named(const mjModel* m, mjtObj type, const std::string& prefix) {
  Named found;
  // the world body is not part of the robot
  const int first = type == mjOBJ_BODY && prefix.empty() ? 1 : 0;
  for (int id = first; id < count_of(m, type); ++id) {
    const std::string name = scene::name_of(m, type, id);
    if (!name.starts_with(prefix)) continue;
    found.names.push_back(name.substr(prefix.size()));
    found.ids.push_back(id);
  }
  return found;
}

bool turns_or_slides(const mjModel* m, int joint) {
  return m->jnt_type[joint] == mjJNT_HINGE || m->jnt_type[joint] == mjJNT_SLIDE;
}

// Adds the joints that an actuator drives: its own joint, or those of its tendon.
void add_driven(const mjModel* m, int actuator, std::set<int>& joints) {
  const int target = m->actuator_trnid[2 * actuator];
  switch (m->actuator_trntype[actuator]) {
    case mjTRN_JOINT:
    case mjTRN_JOINTINPARENT:
      if (turns_or_slides(m, target)) joints.insert(target);
      return;
    case mjTRN_TENDON:
      for (int i = 0; i < m->tendon_num[target]; ++i) {
        const int wrap = m->tendon_adr[target] + i;
        const int joint = m->wrap_objid[wrap];
        if (m->wrap_type[wrap] == mjWRAP_JOINT && turns_or_slides(m, joint)) joints.insert(joint);
      }
      return;
    default:
      return;
  }
}

MoveGroupCfg group_of(const std::string& name, const std::string& body) {
  MoveGroupCfg group;
  group.name = name;
  group.kind = GroupKind::kActuators;
  group.root_body = body;
  return group;
}

}  // namespace

RobotCfg scene_robot(const mjModel* m, const std::string& entity, const ActuatorGroups& groups,
                     std::string_view context) {
  const std::string prefix = entity.empty() ? "" : entity + "/";
  const Named bodies = named(m, mjOBJ_BODY, prefix), joints = named(m, mjOBJ_JOINT, prefix),
              actuators = named(m, mjOBJ_ACTUATOR, prefix);
  if (!entity.empty() && bodies.names.empty()) {
    std::set<std::string> entities;
    for (const std::string& name : scene::model_names(m, mjOBJ_BODY)) {
      if (name.find('/') != std::string::npos) entities.insert(name.substr(0, name.find('/')));
    }
    throw_unknown(context, "robot entity", entity,
                  std::vector<std::string>(entities.begin(), entities.end()));
  }

  RobotCfg robot;
  robot.name = entity.empty() ? "scene" : entity;
  robot.base_body = entity.empty() ? "world" : bodies.names.front();
  MoveGroupCfg base = group_of("base", robot.base_body);
  base.kind = GroupKind::kBase;
  robot.groups.push_back(base);

  if (groups.empty()) {
    if (actuators.names.empty()) return robot;
    MoveGroupCfg all = group_of("joints", robot.base_body);
    for (std::size_t i = 0; i < joints.ids.size(); ++i) {
      if (turns_or_slides(m, joints.ids[i])) all.joints.push_back(joints.names[i]);
    }
    all.actuators = actuators.names;
    robot.groups.push_back(all);
    return robot;
  }
  std::vector<std::string> owner(actuators.ids.size());
  for (const auto& [name, patterns] : groups) {
    const std::string of_group = fmt::format("{}, move group '{}'", context, name);
    MoveGroupCfg group = group_of(name, robot.base_body);
    std::set<int> driven;
    for (int i : match_names(patterns, actuators.names, of_group)) {
      if (!owner[i].empty()) {
        throw ValueError(fmt::format("{}: actuator '{}' already belongs to move group '{}'",
                                     of_group, actuators.names[i], owner[i]));
      }
      owner[i] = name;
      group.actuators.push_back(actuators.names[i]);
      add_driven(m, actuators.ids[i], driven);
    }
    for (int joint : driven) {
      group.joints.push_back(scene::name_of(m, mjOBJ_JOINT, joint).substr(prefix.size()));
    }
    robot.groups.push_back(group);
  }
  return robot;
}

}  // namespace mjsense::tasks::robots
