// SPDX-License-Identifier: Apache-2.0
#pragma once
// Adapter of a policy written in Python (mjsense.Policy, python/mjsense/tasks/policy.py) for a rollout.
// It is called once per step for all worlds, or once per chunk of actions.

#include <memory>
#include <string>
#include <vector>

#include "mjsense_tasks/episode/policy.h"
#include "mjsense_tasks/episode/task.h"
#include "python/bindings/rollout_host.h"

namespace mjsense::tasks::rollout {
class Rollout;
}  // namespace mjsense::tasks::rollout

namespace mjsense {}

namespace mjsense::python {

// (sensor, spec, rows) of every stream of a rollout's suite. The rows are read-only and may outlive
// the rollout.
nb::list suite_streams(tasks::rollout::Rollout& rollout);
// (name, low, high) of every controlled move group.
nb::list action_layout(const tasks::robots::Robot& robot);

class PythonPolicy final : public tasks::episode::PlannerPolicy {
 public:
  // Requires the GIL.
  PythonPolicy(nb::object policy, std::shared_ptr<PythonHost> host);

  std::string_view name() const override { return name_; }
  void bind(const std::shared_ptr<sim::Simulation>& simulation) override {
    simulation_ = simulation;
  }
  void initialize(tasks::episode::Task& task) override;
  // Call when the suite exists: act() receives its rows.
  void observe(tasks::rollout::Rollout& rollout);
  void reset_all(tasks::episode::ActiveWorlds& worlds) override;
  void act_all(tasks::episode::ActiveWorlds& worlds,
               std::span<tasks::robots::Action> actions) override;

  std::span<const tasks::episode::Phase> phases() const override { return phases_; }
  int phase(int world) const override { return phase_[world]; }
  int num_retries(int world) const override { return retries_[world]; }
  Pose grasp_pose(int /*world*/) const override { return {}; }
  bool has_grasp_pose() const override { return false; }
  std::vector<std::pair<std::string, std::string>> info(int world) const override;
  std::string failure(int world) const override;
  std::vector<std::shared_ptr<Sensor>> create_policy_sensors() const override;

 private:
  // The result of act(): `steps` actions per world, and the number of actions left in each world.
  struct Chunk {
    std::size_t steps = 0;
    std::vector<double> values;        // [B, steps, n]
    std::vector<std::uint8_t> given;   // [B, move groups]
    std::vector<std::uint8_t> done;    // [B], at the last step
    std::vector<std::int8_t> success;  // [B], -1: not reported
    std::vector<std::uint8_t> hold;    // [B, move groups], the group holds its position
    std::vector<std::size_t> left;     // [B]
  };
  std::string place(const char* method) const;
  std::string layout_text() const;
  void call_act();
  void read(nb::handle value);
  void read_group(nb::handle value, std::size_t first, std::size_t width, const std::string& what);
  void read_hold(nb::handle value);
  void read_flags(nb::handle value, const char* what, auto&& set);
  void read_phases();
  // Whether the policy gives a command to the i-th controlled group.
  bool commands(int world, std::size_t i) const {
    return chunk_.given[world * group_.size() + i] && !chunk_.hold[world * group_.size() + i];
  }
  std::string not_finite(int world, const double* values) const;
  void fill(int world, tasks::robots::Action& action);

  PyHandle policy_;
  std::shared_ptr<PythonHost> host_;
  std::weak_ptr<sim::Simulation> simulation_;
  tasks::episode::Task* task_ = nullptr;
  std::string name_;
  std::vector<std::string> phase_names_;
  std::vector<tasks::episode::Phase> phases_;
  std::vector<int> phase_, retries_;  // [B]
  std::vector<std::string> broken_;   // [B], why the last action could not be executed, or ""
  PyHandle act_, observation_, wanted_, as_array_;
  bool* wanted_rows_ = nullptr;     // [B], memory of wanted_
  std::vector<int> group_, width_;  // of the controlled move groups
  std::size_t n_ = 0;               // sum of the widths
  Chunk chunk_;
};

}  // namespace mjsense::python
