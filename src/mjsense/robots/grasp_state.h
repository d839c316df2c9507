// SPDX-License-Identifier: Apache-2.0
#pragma once
// `grasp_state_<role>`: does a gripper touch the object, and does it hold it alone.

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"

namespace mjsense {

// Streams <name>/<gripper>/held and <name>/<gripper>/touching: bool []. Over the contacts that have
// exactly one side in the object: touching = the other side is in this gripper; held = touching,
// and no contact has its other side outside all grippers. No force, no two-finger test: an object
// that rests on the table and touches the gripper is not held.
class GraspStateSensor final : public Sensor {
 public:
  struct Gripper {
    std::string name;  // move group: "gripper"
    std::string body;  // root body; its geoms and those of the bodies below it
  };
  GraspStateSensor(std::string name, BodyRef object, std::vector<Gripper> grippers);
  std::string_view kind() const override { return "grasp_state"; }
  mjtStage needs() const override { return mjSTAGE_POS; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  static constexpr int kMaxGrippers = 30;
  BodyRef object_;
  std::vector<Gripper> grippers_;            // fields 2 i and 2 i + 1 are gripper i's
  std::vector<std::uint32_t> gripper_bits_;  // [ngeom] bit i set: in gripper i
};

}  // namespace mjsense
