// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/function_sensor.h"
#include "mjsense/observe/pose_sensor.h"
#include "mjsense_tasks/episode/policy.h"

namespace mjsense::tasks::episode {

std::vector<std::shared_ptr<Sensor>> PlannerPolicy::create_policy_sensors() const {
  SensorSpec phase, retries;
  phase.low = 0;
  phase.description =
      "Index of the planner's phase before it chooses the next action; obs_scene lists the names.";
  retries.low = 0;
  retries.description = "Number of times that the planner has restarted in this episode.";
  std::vector<std::shared_ptr<Sensor>> sensors;
  sensors.push_back(std::make_shared<observe::FunctionSensor<std::int64_t>>(
      "policy_phase", phase,
      [this](const World& world, std::span<std::int64_t> row) { row[0] = this->phase(world.id); }));
  sensors.push_back(std::make_shared<observe::FunctionSensor<std::int64_t>>(
      "policy_num_retries", retries,
      [this](const World& world, std::span<std::int64_t> row) { row[0] = num_retries(world.id); }));
  if (has_grasp_pose()) {
    sensors.push_back(std::make_shared<observe::FunctionSensor<float>>(
        "grasp_pose",
        observe::pose_spec(
            "world",
            "Pose at which the planner closes the gripper; the identity before the first "
            "plan with a grasp."),
        [this](const World& world, std::span<float> row) {
          write_pose(grasp_pose(world.id), row.data());
        }));
  }
  return sensors;
}

}  // namespace mjsense::tasks::episode
