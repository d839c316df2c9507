// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/action_sensors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::rollout {
namespace {

// True if the policy ended the episode with this observation. For episodes that the task ends see
// blank_actions(). A time-out is not terminal.
bool terminal(const episode::Task& task, const World& world) {
  return task.done_received(world.id);
}

// Values per move group: fields `<group>`, then `given/<group>`.
template <class T>
class ActionSensor : public Sensor {
 public:
  ActionSensor(std::string name, const episode::Task& task, const ActionLog& log)
      : Sensor(std::move(name)), task_(task), log_(log) {}
  std::string_view kind() const override { return "action"; }

  void initialize(const SensorInit& init) override {
    clear_fields();
    rows_.clear();
    const auto groups = task_.robot().groups();
    for (std::size_t g = 0; g < groups.size(); ++g) {
      SensorSpec spec = group_spec(groups[g]);
      if (spec.shape.rank() == 0) continue;
      rows_.push_back({static_cast<int>(g), &add(groups[g].name, spec, init)});
    }
    declare_more(init);
    for (Row& row : rows_) row.given = &add_given(row.numbers->name, init);
  }

  void compute(const World& world) override {
    const bool any = shown(world);
    for (const Row& row : rows_) {
      const std::span<T> numbers = row.numbers->data.template row<T>(world.id);
      const bool given = any && write(world, row.group, numbers);
      if (!given) std::ranges::fill(numbers, T{0});
      row.given->data.template row<bool>(world.id)[0] = given;
    }
  }

 protected:
  // Spec of a group's values; rank 0 if the group has none.
  virtual SensorSpec group_spec(const robots::MoveGroup& group) const = 0;
  virtual void declare_more(const SensorInit& /*init*/) {}
  // Whether any group has an action at this observation.
  virtual bool shown(const World& /*world*/) { return true; }
  // Writes the values of a group. Returns false if it has no action at this observation.
  virtual bool write(const World& world, int group, std::span<T> row) = 0;

  Field& add(std::string_view name, SensorSpec spec, const SensorInit& init) {
    spec.dtype = dtype_of<T>();
    return add_field(name, std::move(spec), init.num_worlds);
  }
  Field& add_given(const std::string& name, const SensorInit& init) {
    SensorSpec spec;
    spec.dtype = DType::kBool;
    spec.description = fmt::format(
        "Whether '{}' has an action at this observation; without one, its action reads 0.", name);
    return add_field("given/" + name, spec, init.num_worlds);
  }

  const robots::MoveGroup& group(int g) const { return task_.robot().groups()[g]; }
  const robots::RobotValues& targets(const World& world) const {
    return task_.robot().targets(world.id);
  }
  bool is_first(const World& world) const { return !log_[world.id].given; }
  const episode::Task& task_;
  const ActionLog& log_;

 private:
  struct Row {
    int group;
    Field* numbers;
    Field* given = nullptr;
  };
  std::vector<Row> rows_;
};

std::int64_t count(const std::vector<int>& ids) { return static_cast<std::int64_t>(ids.size()); }

SensorSpec spec_of(std::int64_t size, std::string unit, std::string frame,
                   std::string description) {
  SensorSpec spec;
  spec.shape = {size};
  spec.unit = std::move(unit);
  spec.frame = std::move(frame);
  spec.description = std::move(description);
  return spec;
}

class CommandedAction final : public ActionSensor<float> {
 public:
  using ActionSensor::ActionSensor;

  void compute(const World& world) override {
    ActionSensor::compute(world);
    const robots::Action* action = task_.last_action(world.id);
    const bool given = action && action->success.has_value();
    verdict_->data.row<float>(world.id)[0] = given && *action->success ? 1.0f : 0.0f;
    verdict_given_->data.row<bool>(world.id)[0] = given;
  }

 protected:
  SensorSpec group_spec(const robots::MoveGroup& g) const override {
    return spec_of(g.command_size, g.command_unit, "",
                   fmt::format("The policy's command to '{}', unchanged.", g.name));
  }
  void declare_more(const SensorInit& init) override {
    verdict_ = &add("success",
                    spec_of(1, "", "", "Whether the policy itself reports success: 1 or 0."), init);
    verdict_given_ = &add_given("success", init);
  }
  bool write(const World& world, int g, std::span<float> row) override {
    const robots::Action* action = task_.last_action(world.id);
    if (!action || !action->commands[g].given) return false;
    std::ranges::transform(action->commands[g].view(), row.begin(),
                           [](double x) { return static_cast<float>(x); });
    return true;
  }

 private:
  Field *verdict_ = nullptr, *verdict_given_ = nullptr;
};

class JointPos final : public ActionSensor<double> {
 public:
  using ActionSensor::ActionSensor;

 protected:
  SensorSpec group_spec(const robots::MoveGroup& g) const override {
    if (g.target_size == 0) return {};
    SensorSpec spec =
        spec_of(g.target_size, g.target_unit, "",
                fmt::format("Target of the controller of '{}', without noise.", g.name));
    // The smallest interval around the control ranges and 0, the value without an action.
    const double low = std::ranges::min(g.ctrl_low), high = std::ranges::max(g.ctrl_high);
    if (low > -mjMAXVAL) spec.low = std::min(0.0, low);
    if (high < mjMAXVAL) spec.high = std::max(0.0, high);
    return spec;
  }
  bool shown(const World& world) override { return !terminal(task_, world); }
  bool write(const World& world, int g, std::span<double> row) override {
    std::ranges::copy(targets(world)[g].view(), row.begin());
    return true;
  }
};

class JointPosRel final : public ActionSensor<double> {
 public:
  using ActionSensor::ActionSensor;

 protected:
  SensorSpec group_spec(const robots::MoveGroup& g) const override {
    return spec_of(
        count(g.qpos), g.targets_are_qpos() ? g.target_unit : "", "",
        fmt::format("Target of '{}' minus its previously observed joint positions.", g.name));
  }
  bool shown(const World& world) override { return is_first(world) || !terminal(task_, world); }
  bool write(const World& world, int g, std::span<double> row) override {
    if (is_first(world)) {
      std::ranges::fill(row, 0.0);
      return true;
    }
    const robots::GroupValues &target = targets(world)[g], &qpos = log_[world.id].qpos[g];
    if (!group(g).targets_are_qpos()) return false;
    for (int i = 0; i < target.size; ++i) row[i] = target.values[i] - qpos.values[i];
    return true;
  }
};

class EePose final : public ActionSensor<double> {
 public:
  using ActionSensor::ActionSensor;

 protected:
  SensorSpec group_spec(const robots::MoveGroup& g) const override {
    const int base = task_.robot().base_body();
    return spec_of(7, "m, wxyz", "body " + scene::name_of(task_.model(), mjOBJ_BODY, base),
                   fmt::format("Target pose of the leaf frame of '{}'.", g.name));
  }
  bool shown(const World& world) override { return !terminal(task_, world); }
  bool write(const World& world, int g, std::span<double> row) override {
    write_pose(task_.robot().target_pose(world, g), row.data());
    return true;
  }
};

class EeTwist final : public ActionSensor<double> {
 public:
  using ActionSensor::ActionSensor;

 protected:
  SensorSpec group_spec(const robots::MoveGroup& g) const override {
    if (g.target_size == 0) return {};
    return spec_of(
        6, "m, rad", "the leaf frame as previously observed",
        fmt::format("Twist of the leaf frame of '{}' to its target pose, per control step.",
                    g.name));
  }
  bool shown(const World& world) override { return is_first(world) || !terminal(task_, world); }
  bool write(const World& world, int g, std::span<double> row) override {
    Twist twist;
    if (!is_first(world)) {
      twist = log6(inverse(log_[world.id].leaf[g]) * task_.robot().target_pose(world, g));
    }
    std::ranges::copy(std::initializer_list<double>{twist.v.x, twist.v.y, twist.v.z, twist.w.x,
                                                    twist.w.y, twist.w.z},
                      row.begin());
    return true;
  }
};

}  // namespace

std::vector<std::shared_ptr<Sensor>> action_sensors(const episode::Task& task,
                                                    const ActionLog& log) {
  return {std::make_shared<CommandedAction>("actions/commanded_action", task, log),
          std::make_shared<JointPos>("actions/joint_pos", task, log),
          std::make_shared<JointPosRel>("actions/joint_pos_rel", task, log),
          std::make_shared<EeTwist>("actions/ee_twist", task, log),
          std::make_shared<EePose>("actions/ee_pose", task, log)};
}

void blank_actions(observe::SensorSuite& suite, int world, bool first) {
  for (const char* name :
       {"actions/joint_pos", "actions/ee_pose", "actions/joint_pos_rel", "actions/ee_twist"}) {
    if (first && (name == std::string_view("actions/joint_pos_rel") ||
                  name == std::string_view("actions/ee_twist"))) {
      continue;  // stay valid: zeros that are marked as given
    }
    Sensor* sensor = suite.find(name);
    if (!sensor) continue;
    for (Field& field : sensor->fields()) {
      std::fill_n(field.data.row_data(world), field.data.row_bytes(), std::byte{0});
    }
  }
}

}  // namespace mjsense::tasks::rollout
