// SPDX-License-Identifier: Apache-2.0
#pragma once
// Commands that are poses. PoseTarget moves a mocap body to a commanded pose at limited speed: the
// base class for bases that are mocap bodies or are welded to one.

#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/robots/controllers/controller.h"

namespace mjsense::tasks::robots {

// The pose of a command x, y, z, w, x, y, z. Throws ValueError if the quaternion is zero; the
// message begins with `context`.
Pose commanded_pose(std::span<const double> command, const std::string& context);

class PoseTarget : public Controller {
 public:
  // `mocap`: index of the mocap body. Its pose is X_WB * X_BM if the base is at X_WB.
  PoseTarget(int mocap, const Pose& base_to_mocap, double max_speed, double max_turn,
             const ControllerInit& init);

  void describe(MoveGroup& group) const override;
  void start(const StateRow& /*state*/) const override {}
  void hold(const World& world, std::span<double> target) override;
  void keep(const World& world, std::span<const double> target,
            std::span<double> command) const override;
  void command(const World& world, std::span<const double> command,
               std::span<double> target) override;
  void begin(const World& world, std::span<const double> target, const StateRow& state) override;
  bool every_step() const override { return true; }
  mjtStage compute(const World& world, int index, const StateRow& state) override;

 protected:
  void write(const Pose& base, const StateRow& state) const;

 private:
  Pose base_at(const mjtNum* mocap_pos, const mjtNum* mocap_quat) const;

  int mocap_;
  Pose base_to_mocap_;
  double max_step_, max_turn_;  // m and rad per control step
  std::string context_;
  struct Goal {
    bool given = false;
    Pose base;  // X_WB
  };
  std::vector<Goal> goals_;  // [B]
};

}  // namespace mjsense::tasks::robots
