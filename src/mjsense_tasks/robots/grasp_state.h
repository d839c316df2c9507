// SPDX-License-Identifier: Apache-2.0
#pragma once
// `grasp_state_<role>`: whether a gripper touches the object, and whether only grippers do.

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"

namespace mjsense::tasks::robots {

// Streams <name>/<gripper>/held and <name>/<gripper>/touching: bool []. Only contacts with exactly
// one geom in the object count. touching: the other geom is in this gripper. held: touching, and no
// contact has its other geom outside all grippers. There is no force threshold and no two-finger
// test: an object that rests on the table and touches the gripper is not held.
class GraspStateSensor final : public Sensor {
 public:
  struct Gripper {
    std::string name;  // move group, e.g. "gripper"
    std::string body;  // root body; the gripper consists of the geoms of its subtree
  };
  GraspStateSensor(std::string name, observe::BodyRef object, std::vector<Gripper> grippers);
  std::string_view kind() const override { return "grasp_state"; }
  mjtStage needs() const override { return mjSTAGE_POS; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  static constexpr int kMaxGrippers = 30;
  observe::BodyRef object_;
  std::vector<Gripper> grippers_;            // gripper i has fields 2 i and 2 i + 1
  std::vector<std::uint32_t> gripper_bits_;  // [nbody]; bit i is set if the body is in gripper i
};

}  // namespace mjsense::tasks::robots
