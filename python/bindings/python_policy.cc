// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/python_policy.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/text/counted.h"
#include "mjsense_tasks/rollout/rollout.h"
#include "python/bindings/fields.h"
#include "python/bindings/numpy.h"

namespace mjsense::python {
namespace {

using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Ints = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

std::string shape_text(const Numbers& array) {
  std::vector<std::size_t> dims;
  for (std::size_t i = 0; i < array.ndim(); ++i) dims.push_back(array.shape(i));
  return fmt::format("({}{})", fmt::join(dims, ", "), dims.size() == 1 ? "," : "");
}

}  // namespace

nb::list suite_streams(tasks::rollout::Rollout& rollout) {
  nb::list list;
  for (const auto& sensor : rollout.suite().sensors()) {
    // Keep the simulation alive too, because some rows belong to a camera of the scene.
    auto keep =
        std::make_shared<std::pair<std::shared_ptr<sim::Simulation>, std::shared_ptr<Sensor>>>(
            rollout.simulation_ptr(), sensor);
    nb::object owner = owner_of(keep);
    for (Field& field : sensor->fields()) {
      list.append(nb::make_tuple(sensor->name(), nb::cast(field.spec, nb::rv_policy::copy),
                                 to_readonly_numpy(field.data.view(), owner)));
    }
  }
  return list;
}

nb::list action_layout(const tasks::robots::Robot& robot) {
  nb::list layout;
  for (const tasks::robots::MoveGroup& group : robot.groups()) {
    if (group.controlled())
      layout.append(nb::make_tuple(group.name, group.command_low, group.command_high));
  }
  return layout;
}

PythonPolicy::PythonPolicy(nb::object policy, std::shared_ptr<PythonHost> host)
    : policy_(policy), host_(std::move(host)) {
  nb::object settings = policy.attr("_mjs_settings")();
  name_ = nb::cast<std::string>(settings["name"]);
  for (auto [name, number] : nb::cast<nb::dict>(settings["phases"])) {
    phase_names_.push_back(nb::cast<std::string>(name));
    phases_.push_back({"", nb::cast<int>(number)});
  }
  for (std::size_t i = 0; i < phases_.size(); ++i) phases_[i].name = phase_names_[i];
  as_array_ = PyHandle(nb::module_::import_("numpy").attr("ascontiguousarray"));
}

std::string PythonPolicy::place(const char* method) const {
  return fmt::format("policy '{}': {}()", name_, method);
}

// For example "(64, 8), or (64, H, 8) for H steps, with the columns arm 7, gripper 1".
std::string PythonPolicy::layout_text() const {
  std::vector<std::string> groups;
  for (std::size_t i = 0; i < group_.size(); ++i)
    groups.push_back(fmt::format("{} {}", task_->robot().groups()[group_[i]].name, width_[i]));
  const int B = task_->num_worlds();
  return fmt::format("({0}, {1}), or ({0}, H, {1}) for H steps, with the columns {2}", B, n_,
                     fmt::join(groups, ", "));
}

void PythonPolicy::initialize(tasks::episode::Task& task) {
  task_ = &task;
  const auto B = static_cast<std::size_t>(task.num_worlds());
  group_.clear();
  width_.clear();
  n_ = 0;
  const auto groups = task.robot().groups();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (!groups[g].controlled()) continue;
    group_.push_back(static_cast<int>(g));
    width_.push_back(groups[g].command_size);
    n_ += groups[g].command_size;
  }
  broken_.assign(B, "");
  phase_.assign(B, 0);
  retries_.assign(B, 0);
  chunk_ = {.given = std::vector<std::uint8_t>(B * group_.size()),
            .done = std::vector<std::uint8_t>(B),
            .success = std::vector<std::int8_t>(B),
            .hold = std::vector<std::uint8_t>(B * group_.size()),
            .left = std::vector<std::size_t>(B)};
}

void PythonPolicy::observe(tasks::rollout::Rollout& rollout) {
  host_->call(place("initialize"), [&] {
    nb::object policy = nb::borrow(policy_.get());
    nb::object bound =
        policy.attr("_mjs_bind")(host_->simulation(rollout.simulation_ptr()),
                                 suite_streams(rollout), action_layout(task_->robot()));
    observation_ = PyHandle(nb::object(bound[0]));
    wanted_ = PyHandle(nb::object(bound[1]));
    wanted_rows_ = nb::cast<nb::ndarray<bool, nb::ndim<1>, nb::c_contig>>(wanted_.get()).data();
    act_ = PyHandle(policy.attr("act"));
  });
}

std::vector<std::shared_ptr<Sensor>> PythonPolicy::create_policy_sensors() const {
  std::vector<std::shared_ptr<Sensor>> sensors;
  if (!phases_.empty()) sensors = tasks::episode::PlannerPolicy::create_policy_sensors();
  host_->call(place("sensors"), [&] {
    for (auto& own : host_->members(policy_.get().attr("_mjs_sensors")(), simulation_.lock()))
      sensors.push_back(std::move(own));
  });
  return sensors;
}

std::vector<std::pair<std::string, std::string>> PythonPolicy::info(int world) const {
  return host_->call(place("info"), [&] {
    std::vector<std::pair<std::string, std::string>> all;
    for (auto [key, text] : dict_of(policy_.get().attr("info")(world)))
      all.emplace_back(nb::cast<std::string>(nb::str(key)), nb::cast<std::string>(nb::str(text)));
    return all;
  });
}

std::string PythonPolicy::failure(int world) const {
  if (!broken_[world].empty()) return broken_[world];
  return host_->call(place("failure"), [&] {
    return nb::cast<std::string>(nb::str(policy_.get().attr("failure")(world)));
  });
}

void PythonPolicy::reset_all(tasks::episode::ActiveWorlds& worlds) {
  for (int w : worlds.ids()) {
    chunk_.left[w] = 0;
    broken_[w].clear();
  }
  host_->call(place("reset"), [&] {
    nb::list ids, episodes, instructions;
    for (int w : worlds.ids()) {
      ids.append(w);
      episodes.append(task_->episode(w));
      instructions.append(task_->instruction(w));
    }
    policy_.get().attr("_mjs_reset")(ids, episodes, task_->cfg().seed, instructions);
    read_phases();
  });
}

void PythonPolicy::act_all(tasks::episode::ActiveWorlds& worlds,
                           std::span<tasks::robots::Action> actions) {
  bool any = false;
  for (int w : worlds.ids()) any |= chunk_.left[w] == 0;
  if (any) {
    std::fill_n(wanted_rows_, task_->num_worlds(), false);
    for (int w : worlds.ids()) wanted_rows_[w] = chunk_.left[w] == 0;
    host_->call(place("act"), [&] { call_act(); });
  }
  for (int w : worlds.ids()) fill(w, actions[w]);
}

void PythonPolicy::call_act() {
  nb::object found = act_.get()(observation_.get());
  const auto B = static_cast<std::size_t>(task_->num_worlds());
  if (found.is_none())
    throw ValueError(
        fmt::format("{} returned None, expected actions of shape ({}, {})", place("act"), B, n_));
  const std::size_t before = chunk_.steps;
  std::vector<double> kept;
  if (before > 1) kept = chunk_.values;
  read(found);
  // Worlds in the middle of a chunk continue it.
  if (before > 1 && std::ranges::any_of(chunk_.left, [](std::size_t left) { return left > 0; })) {
    if (before != chunk_.steps) {
      throw ValueError(fmt::format("{} returned {}, and {} before: a chunk has always as many",
                                   place("act"), counted(chunk_.steps, "step"), before));
    }
    const std::size_t row = before * n_;
    for (std::size_t w = 0; w < B; ++w) {
      if (!wanted_rows_[w] && chunk_.left[w] > 0)
        std::copy_n(kept.begin() + w * row, row, chunk_.values.begin() + w * row);
    }
  }
  for (std::size_t w = 0; w < B; ++w) {
    if (wanted_rows_[w]) chunk_.left[w] = chunk_.steps;
  }
  read_phases();
}

void PythonPolicy::read(nb::handle value) {
  const auto B = static_cast<std::size_t>(task_->num_worlds());
  chunk_.steps = 0;
  // Values of worlds in the middle of a chunk are kept.
  const auto give = [&](std::size_t first, std::size_t count, bool given) {
    for (std::size_t w = 0; w < B; ++w) {
      if (wanted_rows_[w]) std::fill_n(&chunk_.given[w * group_.size()] + first, count, given);
    }
  };
  for (std::size_t w = 0; w < B; ++w) {
    if (!wanted_rows_[w]) continue;
    std::fill_n(&chunk_.hold[w * group_.size()], group_.size(), 0);
    chunk_.done[w] = 0;
    chunk_.success[w] = -1;
  }
  if (!nb::isinstance<nb::dict>(value)) {
    give(0, group_.size(), true);
    return read_group(value, 0, n_, "");
  }
  give(0, group_.size(), false);
  for (auto [key, item] : nb::cast<nb::dict>(value)) {
    const auto name = nb::cast<std::string>(key);
    if (name == "done") {
      read_flags(item, "done", [&](std::size_t w, double x) { chunk_.done[w] = x != 0; });
      continue;
    }
    if (name == "success") {
      read_flags(item, "success", [&](std::size_t w, double x) {
        chunk_.success[w] = std::isnan(x) ? std::int8_t{-1} : std::int8_t{x != 0};
      });
      continue;
    }
    if (name == "hold") {
      read_hold(item);
      continue;
    }
    if (name == "action") {
      give(0, group_.size(), true);
      read_group(item, 0, n_, "");
      continue;
    }
    std::size_t first = 0, i = 0;
    std::vector<std::string> names{"action", "done", "success", "hold"};
    for (; i < group_.size(); ++i) {
      const std::string& group = task_->robot().groups()[group_[i]].name;
      if (group == name) break;
      names.push_back(group);
      first += width_[i];
    }
    if (i == group_.size()) throw_unknown(place("act"), "move group", name, names);
    give(i, 1, true);
    read_group(item, first, width_[i], name);
  }
  if (chunk_.steps == 0) {  // only flags were returned: all groups hold their position
    chunk_.steps = 1;
    chunk_.values.assign(B * n_, 0.0);
  }
}

// Reads a group's commands into columns first .. first + width of the actions.
void PythonPolicy::read_group(nb::handle value, std::size_t first, std::size_t width,
                              const std::string& what) {
  const auto B = static_cast<std::size_t>(task_->num_worlds());
  Numbers array;
  if (!nb::try_cast(value, array, false)) {
    array = nb::cast<Numbers>(as_array_.get()(value, nb::arg("dtype") = "float64"));
  }
  const bool flat = array.ndim() == 2, chunk = array.ndim() == 3;
  if (!(flat || chunk) || array.shape(0) != B || array.shape(array.ndim() - 1) != width ||
      (chunk && array.shape(1) == 0)) {
    const std::string expected =
        what.empty() ? layout_text() : fmt::format("({0}, {1}), or ({0}, H, {1})", B, width);
    throw ValueError(fmt::format("{} returned {}shape {}, expected {}", place("act"),
                                 what.empty() ? "" : fmt::format("'{}' of ", what),
                                 shape_text(array), expected));
  }
  const std::size_t steps = chunk ? array.shape(1) : 1;
  if (chunk_.steps != 0 && chunk_.steps != steps) {
    throw ValueError(fmt::format("{}: '{}' has {}, another group {}", place("act"), what,
                                 counted(steps, "step"), chunk_.steps));
  }
  chunk_.steps = steps;
  chunk_.values.resize(B * steps * n_);
  const double* from = array.data();
  for (std::size_t row = 0; row < B * steps; ++row) {
    std::copy_n(from + row * width, width, chunk_.values.begin() + row * n_ + first);
  }
}

void PythonPolicy::read_flags(nb::handle value, const char* what, auto&& set) {
  const auto B = static_cast<std::size_t>(task_->num_worlds());
  const auto flags = nb::cast<Numbers>(as_array_.get()(value, nb::arg("dtype") = "float64"));
  if (flags.ndim() != 1 || flags.shape(0) != B) {
    throw ValueError(fmt::format("{} returned '{}' of shape {}, expected ({},)", place("act"), what,
                                 shape_text(flags), B));
  }
  for (std::size_t w = 0; w < B; ++w) {
    if (wanted_rows_[w]) set(w, flags.data()[w]);
  }
}

void PythonPolicy::read_hold(nb::handle value) {
  const auto B = static_cast<std::size_t>(task_->num_worlds()), groups = group_.size();
  const auto flags = nb::cast<Numbers>(as_array_.get()(value, nb::arg("dtype") = "float64"));
  const bool of_groups = flags.ndim() == 2 && flags.shape(1) == groups;
  if ((flags.ndim() != 1 && !of_groups) || flags.shape(0) != B) {
    throw ValueError(
        fmt::format("{} returned 'hold' of shape {}, expected ({},) or ({}, {}): move groups",
                    place("act"), shape_text(flags), B, B, groups));
  }
  for (std::size_t w = 0; w < B; ++w) {
    for (std::size_t i = 0; wanted_rows_[w] && i < groups; ++i)
      chunk_.hold[w * groups + i] = flags.data()[of_groups ? w * groups + i : w] != 0;
  }
}

void PythonPolicy::read_phases() {
  if (phases_.empty()) return;
  const auto read_ints = [&](const char* attribute, std::vector<int>& out) {
    nb::object array = as_array_.get()(policy_.get().attr(attribute), nb::arg("dtype") = "int64");
    const auto values = nb::cast<Ints>(array);
    if (values.size() != out.size()) {
      throw ValueError(fmt::format("policy '{}': {} has {} for {}", name_, attribute,
                                   counted(values.size(), "value"), counted(out.size(), "world")));
    }
    std::copy_n(values.data(), out.size(), out.begin());
  };
  read_ints("phase", phase_);
  read_ints("num_retries", retries_);
}

// "policy 'net' returned an action that is not finite (arm[2] is nan)", or "".
std::string PythonPolicy::not_finite(int world, const double* values) const {
  for (std::size_t i = 0; i < group_.size(); ++i) {
    for (int k = 0; commands(world, i) && k < width_[i]; ++k) {
      if (std::isfinite(values[k])) continue;
      return fmt::format("policy '{}' returned an action that is not finite ({}[{}] is {})", name_,
                         task_->robot().groups()[group_[i]].name, k, values[k]);
    }
    values += width_[i];
  }
  return "";
}

void PythonPolicy::fill(int world, tasks::robots::Action& action) {
  const std::size_t at = chunk_.steps - chunk_.left[world];
  const double* values = chunk_.values.data() + (world * chunk_.steps + at) * n_;
  broken_[world] = not_finite(world, values);
  if (!broken_[world].empty()) {  // The groups hold their position in the last step of the episode.
    chunk_.left[world] = 0;
    action.done = true;
    action.success = false;
    return;
  }
  for (std::size_t i = 0; i < group_.size(); ++i) {
    if (commands(world, i))
      action.commands[group_[i]].set({values, static_cast<std::size_t>(width_[i])});
    values += width_[i];
  }
  if (--chunk_.left[world] > 0) return;
  action.done = chunk_.done[world] != 0;
  if (chunk_.success[world] >= 0) action.success = chunk_.success[world] != 0;
}

}  // namespace mjsense::python
