// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/pose_sensor.h"
#include "mjsense/robots/robot.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::robots {

// One tool pose for each gripper: `tcp_pose` if there is one gripper, else for example
// `tcp_pose_left` for "left_gripper".
std::vector<std::shared_ptr<Sensor>> Robot::create_robot_sensors() const {
  std::vector<const MoveGroup*> grippers;
  for (const MoveGroup& group : groups_) {
    if (group.kind == GroupKind::kGripper) grippers.push_back(&group);
  }
  std::vector<std::shared_ptr<Sensor>> sensors;
  for (const MoveGroup* gripper : grippers) {
    std::string name = "tcp_pose";
    if (grippers.size() > 1) name += "_" + gripper->name.substr(0, gripper->name.find('_'));
    sensors.push_back(std::make_shared<observe::PoseSensor>(
        name,
        observe::PoseSensor::Ref{"site", scene::name_of(model_, mjOBJ_SITE, gripper->leaf_site)},
        observe::PoseSensor::Ref{"body", scene::name_of(model_, mjOBJ_BODY, base_body_)},
        "Pose of the point between the finger tips in the robot's base frame, whose origin is on "
        "the floor."));
  }
  return sensors;
}

std::vector<observe::ImagePointsSensor::Object> Robot::image_objects() const {
  std::vector<observe::ImagePointsSensor::Object> objects;
  for (const MoveGroup& group : groups_) {
    if (group.kind == GroupKind::kGripper)
      objects.push_back(
          {group.name, observe::BodyRef([body = group.root_body](int) { return body; })});
  }
  return objects;
}

std::vector<observe::JointGroup> Robot::joint_groups() const {
  std::vector<observe::JointGroup> groups;
  for (const MoveGroup& group : groups_) groups.push_back({group.name, group.qpos, group.dofs});
  return groups;
}

}  // namespace mjsense::robots
