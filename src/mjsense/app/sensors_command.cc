// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/sensors_command.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "mjsense/app/scene_file.h"
#include "mjsense/app/text_table.h"
#include "mjsense/core/error.h"

namespace mjsense::app {
namespace {

struct Line {
  const SensorSpec* spec;
  double microseconds;  // per step and world; negative: included in the sensor's first stream
};

// Streams of some sensors. The cost of a sensor is given at its first stream. Cost that sensors
// share (one camera of the scene shown as colour and as depth) is included in the first sensor that
// reads it.
std::vector<Line> lines_of(sim::Simulation& simulation, std::span<Sensor* const> sensors,
                           int steps) {
  std::vector<Line> lines;
  std::set<const Sensor*> counted;
  const auto seconds = [&](const Sensor* sensor) {
    if (!counted.insert(sensor).second) return 0.0;
    const sim::Simulation::Cost cost = simulation.cost(*sensor);
    return cost.compute + cost.cast;
  };
  for (Sensor* sensor : sensors) {
    double total = seconds(sensor);
    for (const Sensor* input : sensor->inputs()) total += seconds(input);
    double each = steps > 0 ? 1e6 * total / steps / simulation.num_worlds() : -1;
    for (const Field& field : sensor->fields()) {
      lines.push_back({&field.spec, each});
      each = -1;
    }
  }
  return lines;
}

std::string cost_text(double microseconds) {
  return fmt::format("{:.{}f}", microseconds, microseconds < 10 ? 2 : microseconds < 1000 ? 1 : 0);
}

void print(const std::vector<Line>& lines, bool json) {
  if (json) {
    nlohmann::json out = nlohmann::json::array();
    for (const auto& [spec, cost] : lines) {
      const auto dims = spec->shape.dims();
      nlohmann::json line = {{"name", spec->name},
                             {"dtype", dtype_name(spec->dtype)},
                             {"shape", std::vector<std::int64_t>(dims.begin(), dims.end())},
                             {"unit", spec->unit},
                             {"frame", spec->frame},
                             {"is_dict", spec->is_dict},
                             {"bytes", spec->shape.size() * dtype_size(spec->dtype)},
                             {"description", spec->description}};
      line["microseconds"] = cost < 0 ? nlohmann::json() : nlohmann::json(cost);
      out.push_back(std::move(line));
    }
    fmt::print("{}\n", out.dump(2));
    return;
  }
  Table table{{"name", "shape", "dtype", "unit", "frame", "bytes", "us/step"}, "lllllrr", {}};
  std::size_t total_bytes = 0;
  double total_cost = 0;
  for (const auto& [spec, cost] : lines) {
    const std::size_t bytes = spec->shape.size() * dtype_size(spec->dtype);
    total_bytes += bytes;
    total_cost += std::max(cost, 0.0);
    table.rows.push_back({spec->name, spec->shape.str(),
                          spec->is_dict ? "json" : std::string(dtype_name(spec->dtype)), spec->unit,
                          spec->frame, fmt::format("{}", bytes), cost < 0 ? "" : cost_text(cost)});
  }
  table.rows.push_back({fmt::format("{} streams", lines.size()), "", "", "", "",
                        fmt::format("{}", total_bytes),
                        total_cost > 0 ? cost_text(total_cost) : ""});
  fmt::print("{}", table.text());
}

std::vector<Line> task_lines(tasks::rollout::Rollout& rollout, int steps) {
  const int worlds[] = {0};
  const std::int64_t episodes[] = {0};
  rollout.start(worlds, episodes);
  std::vector<Sensor*> sensors;
  for (const auto& sensor : rollout.suite().sensors()) sensors.push_back(sensor.get());
  int taken = 0;
  for (; taken < steps && rollout.fault(0).empty() && !rollout.evaluation(0).terminal; ++taken) {
    rollout.act();
    rollout.step();
  }
  return lines_of(rollout.simulation(), sensors, taken + (steps > 0 ? 1 : 0));
}

std::vector<Line> scene_lines(sim::Simulation& simulation, int steps, const std::string& context) {
  std::vector<Sensor*> sensors;
  for (const auto& sensor : simulation.scene().sensors()) sensors.push_back(sensor.get());
  simulation.measure_cost(true);
  for (int k = 0; k < steps; ++k) {
    simulation.step();
    simulation.refresh(sensors);
    check_physics(simulation, context);
  }
  return lines_of(simulation, sensors, steps);
}

}  // namespace

int run_sensors(const SensorsOptions& options) {
  if (names_model(options.what, "an MJCF file or the name of a task")) {
    for (const std::string& option : options.given) {
      if (option != "what" && option != "--steps" && option != "--json")
        throw ValueError(
            fmt::format("{} applies to tasks only, and {} is a scene", option, options.what));
    }
    scene::SceneCfg cfg;
    cfg.base.path = options.what;
    sim::Simulation simulation(std::make_shared<scene::Scene>(std::move(cfg)), {});
    print_warnings(simulation.scene());
    print(scene_lines(simulation, options.steps, options.what), options.json);
    return 0;
  }
  tasks::rollout::RolloutCfg rollout_cfg = options.rollout;
  rollout_cfg.task = options.what;
  tasks::rollout::Rollout rollout(rollout_cfg);
  print(task_lines(rollout, options.steps), options.json);
  return 0;
}

}  // namespace mjsense::app
