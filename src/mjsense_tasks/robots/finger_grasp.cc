// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/finger_grasp.h"

#include <fmt/format.h>

#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/touches.h"
#include "mjsense_tasks/robots/robot_sensors.h"

namespace mjsense::tasks::robots {

bool fingers_touch(const World& world, const MoveGroup& gripper, int body) {
  if (body < 0 || gripper.pad_sites[0] < 0 || gripper.pad_sites[1] < 0) return false;
  const mjModel* m = world.model;
  bool touches[2] = {false, false};
  observe::each_touch(world, body, [&](const observe::Touch& touch) {
    for (int f = 0; f < 2; ++f) {
      if (observe::is_descendant_or_self(m, touch.other, m->site_bodyid[gripper.pad_sites[f]]))
        touches[f] = true;
    }
  });
  return touches[0] && touches[1];
}

std::vector<std::shared_ptr<Sensor>> finger_grasp_sensors(const Robot& robot,
                                                          const observe::BodyRef& object) {
  const std::vector<const MoveGroup*> grippers = grippers_of(robot);
  std::vector<std::shared_ptr<Sensor>> sensors;
  if (grippers.size() < 2) return sensors;
  for (const MoveGroup* gripper : grippers) {
    SensorSpec spec;
    spec.shape = {1};
    spec.low = 0;
    spec.high = 1;
    spec.description = fmt::format("Both fingers of '{}' touch the task's object.", gripper->name);
    sensors.push_back(std::make_shared<observe::FunctionSensor<std::uint8_t>>(
        fmt::format("{}_{}_grasp_state", robot.name(), side_of(*gripper)), spec,
        [gripper, object](const World& world, std::span<std::uint8_t> row) {
          row[0] = fingers_touch(world, *gripper, object(world.id)) ? 1 : 0;
        }));
  }
  return sensors;
}

}  // namespace mjsense::tasks::robots
