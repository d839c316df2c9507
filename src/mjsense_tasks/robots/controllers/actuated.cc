// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/controllers/actuated.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::robots {

bool is_position_servo(const mjModel* m, int actuator) {
  const double* gain = m->actuator_gainprm + mjNGAIN * actuator;
  const double* bias = m->actuator_biasprm + mjNBIAS * actuator;
  return m->actuator_trntype[actuator] == mjTRN_JOINT && gain[0] != 0 && gain[0] == -bias[1];
}

bool is_velocity_servo(const mjModel* m, int actuator) {
  const double* gain = m->actuator_gainprm + mjNGAIN * actuator;
  const double* bias = m->actuator_biasprm + mjNBIAS * actuator;
  return m->actuator_trntype[actuator] == mjTRN_JOINT && gain[0] != 0 && bias[1] == 0 &&
         gain[0] == -bias[2];
}

ActuatedController::ActuatedController(const MoveGroup& group, const ControllerInit& init)
    : model_(init.model), group_(group) {
  for (int a : group.actuators) {
    const bool joint = model_->actuator_trntype[a] == mjTRN_JOINT;
    qpos_.push_back(joint ? model_->jnt_qposadr[model_->actuator_trnid[2 * a]] : -1);
  }
}

double ActuatedController::clip(int i, double value) const {
  return std::clamp(value, group_.ctrl_low[i], group_.ctrl_high[i]);
}

std::string ActuatedController::position_unit(int i) const {
  const int a = group_.actuators[i];
  // A position servo has the joint's unit; for other actuators the unit is the control range.
  if (is_position_servo(model_, a))
    return model_->jnt_type[model_->actuator_trnid[2 * a]] == mjJNT_SLIDE ? "m" : "rad";
  if (group_.kind == GroupKind::kGripper)
    return fmt::format("{:g} open .. {:g} closed", group_.open_command, group_.closed_command);
  return fmt::format("{:g} .. {:g}", group_.ctrl_low[i], group_.ctrl_high[i]);
}

std::string ActuatedController::joined_units() const {
  std::set<std::string> units;
  for (int i = 0; i < size(); ++i) units.insert(position_unit(i));
  return fmt::format("{}", fmt::join(units, " or "));
}

void ActuatedController::describe(MoveGroup& group) const {
  group.command_size = group.target_size = size();
  group.command_unit = group.target_unit = joined_units();
  group.command_low = group.ctrl_low;
  group.command_high = group.ctrl_high;
}

void ActuatedController::start(const StateRow& state) const {
  if (group_.kind == GroupKind::kActuators) return;  // keep the scene's controls
  for (int i = 0; i < size(); ++i) {
    const int a = group_.actuators[i];
    state.ctrl[a] = group_.kind == GroupKind::kGripper ? group_.open_command
                    : is_position_servo(model_, a)     ? state.qpos[qpos_[i]]
                                                       : clip(i, 0.0);
  }
}

void ActuatedController::hold(const World& world, std::span<double> target) {
  for (int i = 0; i < size(); ++i) {
    const double value =
        group_.kind == GroupKind::kActuators ? world.data->ctrl[group_.actuators[i]]
        : group_.kind == GroupKind::kGripper
            ? (gripper_is_open(group_, world) ? group_.open_command : group_.closed_command)
        : is_position_servo(model_, group_.actuators[i]) ? position(world, i)
                                                         : 0.0;
    target[i] = clip(i, value);
  }
}

void ActuatedController::keep(const World& /*world*/, std::span<const double> target,
                              std::span<double> command) const {
  std::ranges::fill(command, 0.0);
  std::copy_n(target.begin(), std::min(target.size(), command.size()), command.begin());
}

void ChangeController::keep(const World& /*world*/, std::span<const double> /*target*/,
                            std::span<double> command) const {
  std::ranges::fill(command, 0.0);
}

void ActuatedController::begin(const World& /*world*/, std::span<const double> target,
                               const StateRow& state) {
  for (int i = 0; i < size(); ++i) state.ctrl[group_.actuators[i]] = target[i];
}

void ActuatedController::need_position_servos(const ControllerInit& init, const char* kind,
                                              int count) const {
  if (count > 0 && size() != count) {
    throw ValueError(fmt::format("{}: the controller '{}' needs {}; the group has {}", init.context,
                                 kind, counted(count, "actuator"), size()));
  }
  for (int a : group_.actuators) {
    if (is_position_servo(model_, a)) continue;
    throw ValueError(fmt::format(
        "{}: the controller '{}' needs position servos of joints; the actuator '{}' is not one",
        init.context, kind, scene::name_of(model_, mjOBJ_ACTUATOR, a)));
  }
}

}  // namespace mjsense::tasks::robots
