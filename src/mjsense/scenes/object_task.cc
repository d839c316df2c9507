// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/object_task.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense::scenes {

void ObjectTask::begin(const World& world) {
  episode::Task::begin(world);
  const int body = object(world.id).body;
  subjects_[world.id].start = {vec3(world.data->xpos + 3 * body),
                               quat(world.data->xquat + 4 * body)};
}

Pose ObjectTask::start_pose(int world, std::string_view role) const {
  if (role != role_) {
    const std::vector<std::string> roles{std::string(role_)};
    throw_unknown(fmt::format("task '{}'", name()), "role", role, roles);
  }
  return start(world);
}

void ObjectTask::begin_with(int body, const std::string& name, bool thin) {
  subjects_.assign(num_worlds(), {{std::string(role_), body, name, thin}, {}});
}

void ObjectTask::set_object(int world, int body, const std::string& name) {
  episode::TaskObject& object = subjects_[world].object;
  object.body = body;
  object.name = name;
}

}  // namespace mjsense::scenes
