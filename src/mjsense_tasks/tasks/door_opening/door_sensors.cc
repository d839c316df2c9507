// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/suite.h"
#include "mjsense_tasks/episode/object_sensors.h"
#include "mjsense_tasks/robots/robot_sensors.h"
#include "mjsense_tasks/tasks/door_opening/door_opening.h"

namespace mjsense::tasks {
namespace {

constexpr int kStateLength = 1000;

// First visible geom (group 0 to 2) in the handle's subtree; without one, the first geom; -1: none.
int handle_geom(const mjModel* m, int handle) {
  int fallback = -1;
  for (int g = 0; g < m->ngeom; ++g) {
    if (!observe::is_descendant_or_self(m, m->geom_bodyid[g], handle)) continue;
    if (m->geom_group[g] < 3) return g;
    if (fallback < 0) fallback = g;
  }
  return fallback;
}

}  // namespace

std::shared_ptr<Sensor> door_state_sensor(const DoorOpeningTask& task) {
  return std::make_shared<observe::JsonFunctionSensor>(
      "door_state", kStateLength,
      "How far the door is open, and where its handle and its hinge are.",
      [&task](const World& world, JsonWriter& json) {
        const mjModel* m = world.model;
        const mjData* d = world.data;
        const scenes::Door& door = task.door(world.id);
        const int geom = handle_geom(m, door.handle);
        const double fraction = task.fraction(world), angle = d->qpos[m->jnt_qposadr[door.joint]];
        double extents[3] = {0, 0, 0};
        const double* handle = geom >= 0 ? d->geom_xpos + 3 * geom : d->xpos + 3 * door.handle;
        for (int i = 0; geom >= 0 && i < 3; ++i) extents[i] = 2 * m->geom_aabb[6 * geom + 3 + i];
        json.begin_object();
        json.key("door_position").values({d->xanchor + 3 * door.joint, 3});
        json.key("handle_extents").values(extents);
        json.key("handle_position").values({handle, 3});
        json.key("is_open").begin_array().value(fraction >= DoorOpeningTask::kOpen).end_array();
        json.key("joint_angle").values({&angle, 1});
        json.key("opening_percentage").values({&fraction, 1});
        json.end_object();
      });
}

std::vector<std::shared_ptr<Sensor>> DoorOpeningTask::create_task_sensors() const {
  std::vector<std::shared_ptr<Sensor>> sensors{door_state_sensor(*this)};
  const std::vector<const robots::MoveGroup*> grippers = robots::grippers_of(robot());
  for (const robots::MoveGroup* gripper : grippers) {
    if (grippers.size() > 1)
      sensors.push_back(robots::tool_pose_sensor(model(), robot(), *gripper,
                                                 robots::side_of(*gripper) + "_tcp_pose"));
  }
  if (auto grasped = episode::grasp_state_sensor(*this, std::string(kRole)))
    sensors.push_back(std::move(grasped));
  sensors.push_back(episode::body_poses_sensor(
      *this, "object_poses",
      {{"door", [this](int world) { return door(world).body; }},
       {"door_handle", [this](int world) { return door(world).handle; }}}));
  return sensors;
}

// Removes tcp_pose_<side>: door recordings hold the same pose as <side>_tcp_pose.
void DoorOpeningTask::edit_suite(observe::SensorSuite& suite) const {
  std::vector<std::string> names = suite.names();
  for (const robots::MoveGroup* gripper : robots::grippers_of(robot())) {
    const std::string side = robots::side_of(*gripper);
    if (suite.find(side + "_tcp_pose")) std::erase(names, "tcp_pose_" + side);
  }
  suite.select(names);
}

}  // namespace mjsense::tasks
