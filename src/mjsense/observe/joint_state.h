#pragma once
// `qpos` and `qvel`: the joints of a robot, by move group, as JSON.

#include <string>
#include <vector>

#include "mjsense/observe/json_sensor.h"

namespace mjsense {

// Joints that move together, as addresses into MuJoCo's vectors. A fixed base is a group without
// joints.
struct JointGroup {
  std::string name;
  std::vector<int> qpos;  // addresses into mjData.qpos
  std::vector<int> dof;   // addresses into mjData.qvel
};

// Row {"arm":[...],"base":[],"gripper":[...]}: every group, keys sorted, numbers rounded to float32
// and widened again.
class JointStateSensor final : public JsonSensor {
 public:
  enum class What { kPosition, kVelocity };
  JointStateSensor(std::string name, What what, std::vector<JointGroup> groups,
                   int str_max_len = kDefaultLength);
  mjtStage needs() const override { return mjSTAGE_NONE; }

 protected:
  void write(const World& world, JsonWriter& json) override;
  std::size_t max_bytes() const override;

 private:
  What what_;
  std::vector<JointGroup> groups_;  // sorted by name
};

// Room for one list under a key, in the longest case; shared by every sensor that writes {group:
// numbers}.
std::size_t group_bytes(std::string_view name, std::size_t numbers);

}  // namespace mjsense
