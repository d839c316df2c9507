// SPDX-License-Identifier: Apache-2.0
#pragma once
// `qpos` and `qvel`: joint positions and velocities of a robot, one stream per move group.

#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::observe {

// The joints of a move group, as addresses into MuJoCo's vectors. A fixed base is a group without
// joints.
struct JointGroup {
  std::string name;
  std::vector<int> qpos;  // addresses into mjData.qpos
  std::vector<int> dof;   // addresses into mjData.qvel
};

// Streams <name>/<group>: float32 [n]; [0] for a group without joints. They have no bounds, because
// MuJoCo's joint limits are soft.
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

// Unit of the group's joints: "rad" for rotations, "m" for translations, both if it has both, "" if
// it has no joints. `per`: "/s" for velocities.
std::string joint_unit(const mjModel* model, const JointGroup& group, std::string_view per = "");

}  // namespace mjsense::observe
