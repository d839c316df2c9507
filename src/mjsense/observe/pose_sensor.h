// SPDX-License-Identifier: Apache-2.0
#pragma once
// The pose of a body or site, float32 [7] = position (m), quaternion (wxyz), in the world or in
// another frame.

#include <string>
#include <string_view>

#include "mjsense/core/sensor.h"
#include "mjsense/observe/frame.h"

namespace mjsense {

// `robot_base_pose`: X_WB. `tcp_pose`: X_BT, the tool in the robot's base frame, which stands on
// the floor. Of the two quaternions of a rotation, an episode begins with the one whose w is not
// negative; then each is the one nearer to the last that was computed, so that the sign does not
// flip between steps.
class PoseSensor final : public Sensor {
 public:
  struct Ref {
    std::string type;  // "body" (body frame) or "site"
    std::string name;  // full MuJoCo name
  };
  // `reference` with an empty name: the world.
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

// Unit, shape and bounds of a row of 7.
SensorSpec pose_spec(std::string frame, std::string description);

}  // namespace mjsense
