// SPDX-License-Identifier: Apache-2.0
#pragma once
// A simulation of a scene whose sensors a test reads.

#include <algorithm>
#include <array>
#include <initializer_list>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/sensor.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::testing {

constexpr double kOnItsSide = 0.70710678118654752;  // w and x of a rotation by 90 degrees about x

struct Lab {
  std::shared_ptr<scene::Scene> scene;
  std::unique_ptr<sim::Simulation> sim;

  Lab() = default;
  explicit Lab(scene::SceneCfg s, sim::SimulationCfg cfg = {})
      : scene(std::make_shared<scene::Scene>(std::move(s))),
        sim(std::make_unique<sim::Simulation>(scene, cfg)) {}
  // A scene with one entity.
  Lab(std::string entity, std::string xml, std::vector<std::shared_ptr<const SensorCfg>> sensors,
      sim::SimulationCfg cfg = {})
      : Lab(scene_of(std::move(entity), std::move(xml), std::move(sensors)), cfg) {}

  static scene::SceneCfg scene_of(std::string entity, std::string xml,
                                  std::vector<std::shared_ptr<const SensorCfg>> sensors) {
    scene::SceneCfg s;
    s.entities.emplace_back(std::move(entity), scene::EntityCfg{.model = {.xml = std::move(xml)}});
    s.sensors = std::move(sensors);
    return s;
  }
  template <class Cfg>
  static std::vector<std::shared_ptr<const SensorCfg>> shared(std::vector<Cfg> cfgs) {
    std::vector<std::shared_ptr<const SensorCfg>> out;
    for (Cfg& cfg : cfgs) out.push_back(std::make_shared<Cfg>(std::move(cfg)));
    return out;
  }

  // The present values of a field, of all worlds if world is -1.
  template <class T = float>
  std::vector<T> read(std::string_view field, std::string_view name, int world = -1) {
    Sensor& sensor = scene->sensor(name);
    sim->refresh(sensor);
    const Array& data = sensor.field(field).data;
    const auto values = world < 0 ? data.all<T>() : data.row<T>(world);
    return {values.begin(), values.end()};
  }
  double* qpos(int world = 0) {
    const ArrayView v = sim->worlds().state_component("qpos");
    return reinterpret_cast<double*>(v.data + world * v.strides[0]);
  }
  void pose(std::initializer_list<double> values, int world = 0) {
    std::ranges::copy(values, qpos(world));
    sim->forward(std::array{world});
  }
};

}  // namespace mjsense::testing
