// SPDX-License-Identifier: Apache-2.0
// Controller `differential_base`: commands are a forward speed (m/s) and a turning speed (rad/s).
// For two wheels they are converted to wheel speeds. A base on two slides and a hinge moves along
// its heading, which is read in every control step.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/controllers/actuated.h"
#include "mjsense_tasks/robots/controllers/controller_kinds.h"

namespace mjsense::tasks::robots {
namespace {

class DifferentialBase : public ActuatedController {
 public:
  DifferentialBase(const DifferentialBaseCfg& cfg, const MoveGroup& group,
                   const ControllerInit& init)
      : ActuatedController(group, init), cfg_(cfg), motion_(init.num_worlds) {}
  void describe(MoveGroup& group) const override {
    group.command_size = 2;
    group.command_unit = "m/s, rad/s";
    group.command_low = {-cfg_.max_speed, -cfg_.max_turn};
    group.command_high = {cfg_.max_speed, cfg_.max_turn};
    group.target_size = 0;  // no position target
    group.target_unit = "";
  }
  void hold(const World& world, std::span<double> /*target*/) override { motion_[world.id] = {}; }
  void command(const World& world, std::span<const double> command,
               std::span<double> /*target*/) override {
    motion_[world.id] = {std::clamp(command[0], -cfg_.max_speed, cfg_.max_speed),
                         std::clamp(command[1], -cfg_.max_turn, cfg_.max_turn)};
  }

 protected:
  struct Motion {
    double speed = 0, turn = 0;
  };
  DifferentialBaseCfg cfg_;
  std::vector<Motion> motion_;  // [B]
};

class Wheels final : public DifferentialBase {
 public:
  Wheels(const DifferentialBaseCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : DifferentialBase(cfg, group, init) {
    for (int a : group.actuators) {
      if (is_velocity_servo(init.model, a)) continue;
      throw ValueError(
          fmt::format("{}: the controller 'differential_base' of two wheels needs velocity servos; "
                      "the actuator '{}' is not one",
                      init.context, scene::name_of(init.model, mjOBJ_ACTUATOR, a)));
    }
  }
  void begin(const World& world, std::span<const double> /*target*/,
             const StateRow& state) override {
    const Motion& motion = motion_[world.id];
    const double half = 0.5 * cfg_.track * motion.turn;
    state.ctrl[group_.actuators[0]] = clip(0, (motion.speed - half) / cfg_.wheel_radius);
    state.ctrl[group_.actuators[1]] = clip(1, (motion.speed + half) / cfg_.wheel_radius);
  }
};

class Planar final : public DifferentialBase {
 public:
  Planar(const DifferentialBaseCfg& cfg, const MoveGroup& group, const ControllerInit& init)
      : DifferentialBase(cfg, group, init), dt_(init.periods.ctrl_dt), place_(init.num_worlds) {
    need_position_servos(init, "differential_base", 3);
  }
  void reset(const World& world, std::span<double> target) override {
    hold(world, target);
    for (int i = 0; i < 3; ++i) place_[world.id][i] = position(world, i);
  }
  void begin(const World& world, std::span<const double> /*target*/,
             const StateRow& state) override {
    compute(world, 0, state);
  }
  bool every_step() const override { return true; }
  mjtStage compute(const World& world, int /*index*/, const StateRow& state) override {
    const Motion& motion = motion_[world.id];
    auto& place = place_[world.id];
    const double heading = state.qpos[qpos_[2]];
    place[0] += dt_ * motion.speed * std::cos(heading);
    place[1] += dt_ * motion.speed * std::sin(heading);
    place[2] += dt_ * motion.turn;
    for (int i = 0; i < 3; ++i) {
      place[i] = clip(i, place[i]);
      state.ctrl[group_.actuators[i]] = place[i];
    }
    return mjSTAGE_VEL;
  }

 private:
  double dt_;
  std::vector<std::array<double, 3>> place_;  // [B] targets x, y (m), yaw (rad)
};

}  // namespace

std::unique_ptr<Controller> make_kind(const DifferentialBaseCfg& cfg, const MoveGroup& group,
                                      const ControllerInit& init) {
  if (group.actuators.size() == 2) return std::make_unique<Wheels>(cfg, group, init);
  return std::make_unique<Planar>(cfg, group, init);
}

}  // namespace mjsense::tasks::robots
