#include "mjsense/rollout/action_sensors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "mjsense/observe/joint_state.h"
#include "mjsense/observe/json_sensor.h"

namespace mjsense {
namespace {

// True at an observation after which the episode is over by the policy's word or by success; a
// time-out is not.
bool terminal(const Task& task, const World& world) {
  return task.done_received(world.id) ||
         (task.cfg().terminate_upon_success && task.evaluate(world).success);
}

// "arm: rad; gripper: 0 open .. 255 closed"
template <class Wanted>
std::string command_units(const Task& task, Wanted&& wanted) {
  std::vector<std::string> units;
  for (const MoveGroup& group : task.robot().groups()) {
    if (group.controlled() && wanted(group))
      units.push_back(group.name + ": " + group.command_unit);
  }
  return fmt::format("{}", fmt::join(units, "; "));
}
std::string command_units(const Task& task) {
  return command_units(task, [](const MoveGroup&) { return true; });
}

class ActionSensor : public JsonSensor {
 public:
  ActionSensor(std::string name, std::string description, std::string unit, const Task& task,
               const ActionLog& log)
      : JsonSensor(std::move(name), kDefaultLength, std::move(description), std::move(unit)),
        task_(task),
        log_(log) {
    const auto groups = task.robot().groups();
    for (std::size_t g = 0; g < groups.size(); ++g) sorted_.push_back(static_cast<int>(g));
    std::ranges::sort(sorted_, {}, [&](int g) -> const std::string& { return groups[g].name; });
  }

 protected:
  const MoveGroup& group(int g) const { return task_.robot().groups()[g]; }
  const RobotValues& targets(const World& world) const { return task_.robot().targets(world.id); }

  // The widest row: every group with `numbers` of its own values, or as many as it has.
  std::size_t bytes(std::size_t numbers = 0) const {
    std::size_t total = 2;
    for (int g : sorted_) {
      const std::size_t own = std::max(group(g).joints.size(), group(g).actuators.size());
      total += group_bytes(group(g).name, numbers ? numbers : own);
    }
    return total;
  }

  const Task& task_;
  const ActionLog& log_;
  std::vector<int> sorted_;  // groups by name
};

class CommandedAction final : public ActionSensor {
 public:
  CommandedAction(const Task& task, const ActionLog& log)
      : ActionSensor("actions/commanded_action", "The policy's action, as it gave it.",
                     command_units(task), task, log) {}

 protected:
  void write(const World& world, JsonWriter& json) override {
    const Action* action = task_.last_action(world.id);
    json.begin_object();
    bool verdict = action && action->success.has_value();
    const auto write_verdict = [&] {
      const double value = *action->success ? 1.0 : 0.0;
      json.key("success").values(std::span<const double>(&value, 1));
      verdict = false;
    };
    for (int g : sorted_) {
      if (!action || !action->commands[g].given) continue;
      if (verdict && group(g).name > "success") write_verdict();
      json.key(group(g).name).begin_array();
      for (double x : action->commands[g].view()) {
        json.value(static_cast<double>(static_cast<float>(x)));
      }
      json.end_array();
    }
    if (verdict) write_verdict();
    json.end_object();
  }
  std::size_t max_bytes() const override { return bytes() + group_bytes("success", 1); }
};

class JointPos final : public ActionSensor {
 public:
  JointPos(const Task& task, const ActionLog& log)
      : ActionSensor("actions/joint_pos", "Targets of the controllers, without noise.",
                     command_units(task), task, log) {}

 protected:
  void write(const World& world, JsonWriter& json) override {
    json.begin_object();
    if (!terminal(task_, world)) {
      for (int g : sorted_) {
        if (group(g).controlled()) json.key(group(g).name).values(targets(world)[g].view());
      }
    }
    json.end_object();
  }
  std::size_t max_bytes() const override { return bytes(); }
};

bool has_target_for_each_joint(const MoveGroup& group) {
  return group.controlled() && group.actuators.size() == group.joints.size();
}

class JointPosRel final : public ActionSensor {
 public:
  JointPosRel(const Task& task, const ActionLog& log)
      : ActionSensor("actions/joint_pos_rel",
                     "Targets of the controllers minus the joint positions observed before.",
                     command_units(task, has_target_for_each_joint), task, log) {}

 protected:
  void write(const World& world, JsonWriter& json) override {
    const ActionLog::Entry& before = log_[world.id];
    json.begin_object();
    if (!before.given) {
      for (int g : sorted_) {
        json.key(group(g).name).begin_array();
        for (std::size_t i = 0; i < group(g).qpos.size(); ++i) json.value(0.0);
        json.end_array();
      }
    } else if (!terminal(task_, world)) {
      for (int g : sorted_) {
        const GroupValues& target = targets(world)[g];
        const GroupValues& qpos = before.qpos[g];
        if (!has_target_for_each_joint(group(g))) continue;
        json.key(group(g).name).begin_array();
        for (int i = 0; i < target.size; ++i) json.value(target.values[i] - qpos.values[i]);
        json.end_array();
      }
    }
    json.end_object();
  }
  std::size_t max_bytes() const override { return bytes(); }
};

class EePose final : public ActionSensor {
 public:
  EePose(const Task& task, const ActionLog& log)
      : ActionSensor("actions/ee_pose",
                     "Where the targets put each group's leaf: robot base frame.", "m, wxyz", task,
                     log) {}

 protected:
  void write(const World& world, JsonWriter& json) override {
    json.begin_object();
    if (!terminal(task_, world)) {
      for (int g : sorted_) {
        double row[7];
        write_pose(task_.robot().fk(g, targets(world)), row);
        json.key(group(g).name).values(std::span<const double>(row));
      }
    }
    json.end_object();
  }
  std::size_t max_bytes() const override { return bytes(7); }
};

class EeTwist final : public ActionSensor {
 public:
  EeTwist(const Task& task, const ActionLog& log)
      : ActionSensor("actions/ee_twist",
                     "Twist from each leaf as observed before to where the targets put it, in that "
                     "leaf's axes, per control step.",
                     "m, rad", task, log) {}

 protected:
  void write(const World& world, JsonWriter& json) override {
    const ActionLog::Entry& before = log_[world.id];
    json.begin_object();
    if (!before.given || !terminal(task_, world)) {
      for (int g : sorted_) {
        if (!group(g).controlled()) continue;
        Twist twist;
        if (before.given) {
          twist = log6(inverse(before.leaf[g]) * task_.robot().fk(g, targets(world)));
        }
        const double row[6] = {twist.v.x, twist.v.y, twist.v.z, twist.w.x, twist.w.y, twist.w.z};
        json.key(group(g).name).values(std::span<const double>(row));
      }
    }
    json.end_object();
  }
  std::size_t max_bytes() const override { return bytes(6); }
};

}  // namespace

std::vector<std::shared_ptr<Sensor>> action_sensors(const Task& task, const ActionLog& log) {
  return {std::make_shared<CommandedAction>(task, log), std::make_shared<JointPos>(task, log),
          std::make_shared<JointPosRel>(task, log), std::make_shared<EeTwist>(task, log),
          std::make_shared<EePose>(task, log)};
}

}  // namespace mjsense
