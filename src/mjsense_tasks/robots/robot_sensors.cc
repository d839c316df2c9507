// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/robot_sensors.h"

#include "mjsense/observe/pose_sensor.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::robots {

std::vector<const MoveGroup*> grippers_of(const Robot& robot) {
  std::vector<const MoveGroup*> grippers;
  for (const MoveGroup& group : robot.groups()) {
    if (group.kind == GroupKind::kGripper) grippers.push_back(&group);
  }
  return grippers;
}

std::string side_of(const MoveGroup& gripper) {
  return gripper.name.substr(0, gripper.name.find('_'));
}

std::shared_ptr<Sensor> tool_pose_sensor(const mjModel* model, const Robot& robot,
                                         const MoveGroup& gripper, std::string name) {
  return std::make_shared<observe::PoseSensor>(
      std::move(name),
      observe::PoseSensor::Ref{"site", scene::name_of(model, mjOBJ_SITE, gripper.leaf_site)},
      observe::PoseSensor::Ref{"body", scene::name_of(model, mjOBJ_BODY, robot.base_body())},
      "Pose of the point between the finger tips in the robot's base frame, whose origin is on "
      "the floor.");
}

// One tool pose for each gripper: `tcp_pose` if there is one gripper, else for example
// `tcp_pose_left` for "left_gripper".
std::vector<std::shared_ptr<Sensor>> Robot::create_robot_sensors() const {
  const std::vector<const MoveGroup*> grippers = grippers_of(*this);
  std::vector<std::shared_ptr<Sensor>> sensors;
  for (const MoveGroup* gripper : grippers)
    sensors.push_back(tool_pose_sensor(
        model_, *this, *gripper,
        grippers.size() > 1 ? "tcp_pose_" + side_of(*gripper) : std::string("tcp_pose")));
  return sensors;
}

std::vector<observe::ImagePointsSensor::Object> Robot::image_objects() const {
  std::vector<observe::ImagePointsSensor::Object> objects;
  for (const MoveGroup* gripper : grippers_of(*this))
    objects.push_back(
        {gripper->name, observe::BodyRef([body = gripper->root_body](int) { return body; })});
  return objects;
}

std::vector<observe::JointGroup> Robot::joint_groups() const {
  std::vector<observe::JointGroup> groups;
  for (const MoveGroup& group : groups_) groups.push_back({group.name, group.qpos, group.dofs});
  return groups;
}

}  // namespace mjsense::tasks::robots
