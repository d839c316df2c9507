// SPDX-License-Identifier: Apache-2.0
#pragma once
// `qpos` and `qvel`: the joints of a robot, one stream a move group.

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense {

// Joints that move together, as addresses into MuJoCo's vectors. A fixed base is a group without
// joints.
struct JointGroup {
  std::string name;
  std::vector<int> qpos;  // addresses into mjData.qpos
  std::vector<int> dof;   // addresses into mjData.qvel
};

// Streams <name>/<group>: float32 [n], a group without joints has none of them: [0]. Without
// bounds: MuJoCo's limits of joints are soft.
class JointStateSensor final : public Sensor {
 public:
  enum class What { kPosition, kVelocity };
  JointStateSensor(std::string name, What what, std::vector<JointGroup> groups);
  std::string_view kind() const override { return "joint_state"; }
  mjtStage needs() const override { return mjSTAGE_NONE; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 private:
  const std::vector<int>& addresses(const JointGroup& group) const {
    return what_ == What::kPosition ? group.qpos : group.dof;
  }

  What what_;
  std::vector<JointGroup> groups_;  // field i belongs to group i
};

// "rad", "m" or both for joints that turn and slide, "" for none. `per`: "/s" for velocities.
std::string joint_unit(const mjModel* model, const JointGroup& group, std::string_view per = "");

}  // namespace mjsense
