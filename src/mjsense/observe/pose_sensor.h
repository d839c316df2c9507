// SPDX-License-Identifier: Apache-2.0
#pragma once
// Pose of a body or site, float32 [7] = position (m), quaternion (wxyz), in the world or in another
// frame.

#include <string>
#include <string_view>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"

namespace mjsense::observe {

// `robot_base_pose` is X_WB. `tcp_pose` is X_BT, the tool in the robot's base frame, which is at
// floor level. Each rotation has two quaternions. The first of an episode has w >= 0; each later one
// is the one closer to the previous quaternion, so the sign does not flip between steps.
class PoseSensor final : public Sensor {
 public:
  struct Ref {
    std::string type;  // "body" (body frame) or "site"
    std::string name;  // full MuJoCo name
  };
  // A `reference` with an empty name is the world.
  PoseSensor(std::string name, Ref frame, Ref reference = {}, std::string description = "");
  std::string_view kind() const override { return "pose"; }
  mjtStage needs() const override { return mjSTAGE_POS; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;
  void reset(const World& world) override;

 private:
  Ref frame_ref_, reference_ref_;
  std::string description_;
  Frame frame_, reference_;
};

// Spec of a pose's row of 7 values.
SensorSpec pose_spec(std::string frame, std::string description);

}  // namespace mjsense::observe
