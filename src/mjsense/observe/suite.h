// SPDX-License-Identifier: Apache-2.0
#pragma once
// An ordered set of sensors with unique names: the observations of a policy and the contents of a
// recording.
//
// A suite is built in layers: the task's sensors, then the robot's, then the policy's. Each layer
// has a name, so that the error for a duplicate sensor can name both layers.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/worlds/world_ids.h"

namespace mjsense::sim {
class Simulation;
}  // namespace mjsense::sim

namespace mjsense::observe {

class SensorSuite {
 public:
  // Throws ValueError if the name is taken: "'qpos' is duplicated sensor uuid: from task 'pick' and
  // from robot 'franka'".
  void add(std::shared_ptr<Sensor> sensor, std::string_view owner = "");
  // Adds the sensors in order. The first duplicate throws; the sensors before it stay added.
  void extend(std::span<const std::shared_ptr<Sensor>> sensors, std::string_view owner = "");

  // Keeps only these sensors, in this order. Throws KeyError for an unknown name, and ValueError
  // for a repeated name or if the suite is bound.
  void select(std::span<const std::string> names);

  std::span<const std::shared_ptr<Sensor>> sensors() const { return sensors_; }
  std::size_t size() const { return sensors_.size(); }
  std::vector<std::string> names() const;
  Sensor* find(std::string_view name) const;              // null if there is none
  Sensor& get(std::string_view name) const;               // throws KeyError with the nearest names
  const std::string& owner(std::string_view name) const;  // throws KeyError with the nearest names

  // Adds the sensors to the simulation, each once. Sensors that are added later need another call.
  // The simulation must outlive the suite.
  void bind(sim::Simulation& simulation);
  // Updates every row in the worlds `ids`.
  void refresh(worlds::WorldIds ids = worlds::all_worlds);
  // Fields of all sensors, in order; a sensor can have several. Valid after bind().
  std::vector<const Field*> streams() const;
  const Field& stream(std::string_view name) const;  // throws KeyError with the nearest names

 private:
  int index(std::string_view name) const;  // -1 if there is none

  std::vector<std::shared_ptr<Sensor>> sensors_;
  std::vector<std::string> owners_;  // name of each sensor's layer: "task 'pick'"
  std::vector<Sensor*> bound_;       // sensors that are in the simulation, a prefix of sensors_
  sim::Simulation* simulation_ = nullptr;
};

}  // namespace mjsense::observe
