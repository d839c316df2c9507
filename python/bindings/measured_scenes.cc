// SPDX-License-Identifier: Apache-2.0
// The commands `sensors` and `scan`: streams of a scene or task with their cost, and a lidar's point
// cloud.

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/system/print_stderr.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/lidar/lidar_sensor.h"
#include "mjsense/sensors/lidar/point_cloud.h"
#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/rollout/rollout.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"

namespace mjsense::python {

namespace nb = nanobind;

namespace {

// A scene that is an MJCF file alone. Prints its warnings on stderr.
std::shared_ptr<scene::Scene> scene_of(const std::filesystem::path& model,
                                       std::shared_ptr<SensorCfg> sensor = nullptr) {
  scene::SceneCfg cfg;
  cfg.base.path = model.string();
  if (sensor) cfg.sensors.push_back(std::move(sensor));
  auto made = std::make_shared<scene::Scene>(std::move(cfg));
  for (const std::string& text : made->warnings()) print_stderr("mjsense: {}\n", text);
  return made;
}

// Measurements of a diverged simulation are meaningless.
void check_physics(const sim::Simulation& simulation, const std::filesystem::path& model) {
  if (simulation.failures().empty()) return;
  throw RuntimeError(
      fmt::format("{}: the physics failed: {}", model.string(), simulation.failures()[0].message));
}

// Streams of some sensors as JSON. The cost of a sensor is given at its first stream. Cost that
// sensors share (one camera of the scene shown as colour and as depth) is included in the first
// sensor that reads it. `steps` 0: no cost is measured.
std::string streams_json(sim::Simulation& simulation, std::span<Sensor* const> sensors, int steps) {
  nlohmann::json out = nlohmann::json::array();
  std::set<const Sensor*> counted;
  const auto seconds = [&](const Sensor* sensor) {
    if (!counted.insert(sensor).second) return 0.0;
    const sim::Simulation::Cost cost = simulation.cost(*sensor);
    return cost.compute + cost.cast;
  };
  for (Sensor* sensor : sensors) {
    double total = seconds(sensor);
    for (const Sensor* input : sensor->inputs()) total += seconds(input);
    nlohmann::json cost;  // us per step and world; null at the further streams of a sensor
    if (steps > 0) cost = 1e6 * total / steps / simulation.num_worlds();
    for (const Field& field : sensor->fields()) {
      const SensorSpec& spec = field.spec;
      const auto dims = spec.shape.dims();
      out.push_back({{"name", spec.name},
                     {"dtype", dtype_name(spec.dtype)},
                     {"shape", std::vector<std::int64_t>(dims.begin(), dims.end())},
                     {"unit", spec.unit},
                     {"frame", spec.frame},
                     {"is_dict", spec.is_dict},
                     {"bytes", spec.shape.size() * dtype_size(spec.dtype)},
                     {"description", spec.description},
                     {"microseconds", std::exchange(cost, nullptr)}});
    }
  }
  return out.dump(2);
}

std::string streams_of_task(nb::dict options, int steps) {
  tasks::rollout::RolloutCfg cfg;
  read_options(options, struct_of<tasks::rollout::RolloutCfg>(), &cfg);
  nb::gil_scoped_release unlock;
  tasks::rollout::Rollout rollout(cfg);
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
  return streams_json(rollout.simulation(), sensors, taken + (steps > 0 ? 1 : 0));
}

std::string streams_of_scene(const std::filesystem::path& model, int steps) {
  nb::gil_scoped_release unlock;
  sim::Simulation simulation(scene_of(model), {});
  std::vector<Sensor*> sensors;
  for (const auto& sensor : simulation.scene().sensors()) sensors.push_back(sensor.get());
  simulation.measure_cost(true);
  for (int k = 0; k < steps; ++k) {
    simulation.step();
    simulation.refresh(sensors);
    check_physics(simulation, model);
  }
  return streams_json(simulation, sensors, steps);
}

std::pair<std::int64_t, std::int64_t> scan(const std::filesystem::path& model,
                                           const std::string& type, const std::string& name,
                                           nb::dict lidar, nb::dict pattern,
                                           const std::filesystem::path& out, int steps,
                                           bool world) {
  auto cfg = std::make_shared<sensors::LidarSensorCfg>();
  read_options(lidar, struct_of<sensors::LidarSensorCfg>(), cfg.get());
  cfg->name = "scan";
  cfg->frame = {{type, name, ""}};
  if (pattern.contains("file")) {
    sensors::TableScan table;
    read_options(pattern, struct_of<sensors::TableScan>(), &table);
    cfg->scan = table;
  } else {
    sensors::SpinningScan spinning;
    read_options(pattern, struct_of<sensors::SpinningScan>(), &spinning);
    cfg->scan = spinning;
  }
  nb::gil_scoped_release unlock;
  const std::shared_ptr<scene::Scene> scene = scene_of(model, cfg);
  sim::Simulation simulation(scene, {.decimation = std::max(1, steps)});
  if (steps > 0) simulation.step();
  check_physics(simulation, model);
  Sensor& sensor = scene->sensor("scan");
  simulation.refresh(sensor);
  const auto rows = [&](const char* field) { return sensor.field(field).data.row<float>(0); };
  const std::span<const float> distances = rows("distances");
  sensors::write_point_cloud(out.string(), rows(world ? "hit_pos_w" : "points"), rows("intensity"),
                             distances);
  return {std::ranges::count_if(distances, [](float t) { return t >= 0; }), distances.size()};
}

}  // namespace

void bind_measured_scenes(nb::module_& m) {
  m.def("streams_of_task", &streams_of_task, nb::arg("options"), nb::arg("steps"),
        "The streams of a recording of a task as JSON, with the cost measured over these steps.");
  m.def("streams_of_scene", &streams_of_scene, nb::arg("model"), nb::arg("steps"),
        "The streams of the sensors of an MJCF file as JSON, with their cost.");
  m.def("scan", &scan, nb::arg("model"), nb::arg("type"), nb::arg("name"), nb::arg("lidar"),
        nb::arg("pattern"), nb::arg("out"), nb::arg("steps"), nb::arg("world"),
        "Writes the points that a lidar at a frame of an MJCF file measures after these physics "
        "steps. Returns the number of returns and of rays.");
}

}  // namespace mjsense::python
