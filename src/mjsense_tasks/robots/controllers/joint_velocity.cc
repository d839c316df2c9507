// SPDX-License-Identifier: Apache-2.0
// Controller `joint_velocity`: commands are velocities. Velocity servos take them as controls; for
// position servos the targets move at these velocities, in every control step.
#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/controllers/actuated.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"

namespace mjsense::tasks::robots {
namespace {

class VelocityServos final : public ChangeController {
 public:
  VelocityServos(const MoveGroup& group, const ControllerInit& init)
      : ChangeController(group, init), speed_(init.num_worlds * size()) {}
  void describe(MoveGroup& group) const override {
    ActuatedController::describe(group);
    bool slides = false, turns = false;
    for (int a : group_.actuators)
      (model_->jnt_type[model_->actuator_trnid[2 * a]] == mjJNT_SLIDE ? slides : turns) = true;
    group.command_unit = slides && turns ? "m/s or rad/s" : slides ? "m/s" : "rad/s";
    group.target_size = 0;  // no position target
    group.target_unit = "";
  }
  void hold(const World& world, std::span<double> /*target*/) override {
    std::fill_n(speed_.begin() + world.id * size(), size(), 0.0);
  }
  void command(const World& world, std::span<const double> command,
               std::span<double> /*target*/) override {
    for (int i = 0; i < size(); ++i) speed_[world.id * size() + i] = clip(i, command[i]);
  }
  void begin(const World& world, std::span<const double> /*target*/,
             const StateRow& state) override {
    for (int i = 0; i < size(); ++i)
      state.ctrl[group_.actuators[i]] = speed_[world.id * size() + i];
  }

 private:
  std::vector<double> speed_;  // [B, size]
};

class MovingTargets final : public ChangeController {
 public:
  MovingTargets(const MoveGroup& group, const ControllerInit& init)
      : ChangeController(group, init),
        periods_(init.periods),
        from_(init.num_worlds * size()),
        to_(init.num_worlds * size()) {
    need_position_servos(init, "joint_velocity");
  }
  void describe(MoveGroup& group) const override {
    ActuatedController::describe(group);
    group.command_unit = fmt::format("{}/s", group.command_unit);
    for (int i = 0; i < size(); ++i) {
      const double fastest = (group_.ctrl_high[i] - group_.ctrl_low[i]) / periods_.policy_dt;
      group.command_low[i] = -fastest;
      group.command_high[i] = fastest;
    }
  }
  void reset(const World& world, std::span<double> target) override {
    ActuatedController::hold(world, target);
    hold(world, target);
  }
  // Keeps the targets: servos lag behind them, so the measured positions would make the joints
  // swing back.
  void hold(const World& world, std::span<double> target) override {
    std::copy_n(target.begin(), size(), from_.begin() + world.id * size());
  }
  void command(const World& world, std::span<const double> command,
               std::span<double> target) override {
    // Starts from the last target, not from the measured position: servos lag behind, and starting
    // from the measurement would add that lag at every command.
    std::copy_n(target.begin(), size(), from_.begin() + world.id * size());
    for (int i = 0; i < size(); ++i)
      target[i] = clip(i, target[i] + periods_.policy_dt * command[i]);
  }
  void begin(const World& world, std::span<const double> target, const StateRow& state) override {
    std::copy_n(target.begin(), size(), to_.begin() + world.id * size());
    compute(world, 0, state);
  }
  bool every_step() const override { return true; }
  mjtStage compute(const World& world, int index, const StateRow& state) override {
    const double s = std::min(1.0, (index + 1) * periods_.ctrl_dt / periods_.policy_dt);
    for (int i = 0; i < size(); ++i) {
      const double from = from_[world.id * size() + i], to = to_[world.id * size() + i];
      state.ctrl[group_.actuators[i]] = from + s * (to - from);
    }
    return mjSTAGE_VEL;
  }

 private:
  ControlPeriods periods_;
  std::vector<double> from_, to_;  // [B, size]
};

}  // namespace

std::unique_ptr<Controller> make_kind(const JointVelocityCfg& /*cfg*/, const MoveGroup& group,
                                      const ControllerInit& init) {
  const bool velocity =
      std::ranges::all_of(group.actuators, [&](int a) { return is_velocity_servo(init.model, a); });
  if (velocity) return std::make_unique<VelocityServos>(group, init);
  return std::make_unique<MovingTargets>(group, init);
}

}  // namespace mjsense::tasks::robots
