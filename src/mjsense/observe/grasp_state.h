#pragma once
// `grasp_state_<role>`: does a gripper touch the object, and does it hold it alone.

#include <string>
#include <vector>

#include "mjsense/observe/frame.h"
#include "mjsense/observe/json_sensor.h"

namespace mjsense {

// Row {"gripper":{"held":true,"touching":true}}, one entry a gripper. Over the contacts that have
// exactly one side in the object: touching = the other side is in this gripper; held = touching,
// and no contact has its other side outside all grippers. No force, no two-finger test: an object
// that rests on the table and touches the gripper is not held.
class GraspStateSensor final : public JsonSensor {
 public:
  struct Gripper {
    std::string name;  // move group: "gripper"
    std::string body;  // root body; its geoms and those of the bodies below it
  };
  GraspStateSensor(std::string name, BodyRef object, std::vector<Gripper> grippers,
                   int str_max_len = kDefaultLength);
  mjtStage needs() const override { return mjSTAGE_POS; }

 protected:
  void prepare(const SensorInit& init) override;
  void write(const World& world, JsonWriter& json) override;
  std::size_t max_bytes() const override;

 private:
  static constexpr int kMaxGrippers = 30;
  BodyRef object_;
  std::vector<Gripper> grippers_;            // sorted by name
  std::vector<std::uint32_t> gripper_bits_;  // [ngeom] bit g set: in gripper g
};

}  // namespace mjsense
