// SPDX-License-Identifier: Apache-2.0
#pragma once
// An ordered set of sensors with unique names: what a policy observes and what a recording stores.
//
// Built in layers: the task's sensors, then the robot's, then the policy's. Each layer is named, so
// that a clash of names can say who brought both.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/worlds/world_ids.h"

namespace mjsense {

class Simulation;

class SensorSuite {
 public:
  // Throws ValueError if the name is taken: "'qpos' is duplicated sensor uuid: from task 'pick' and
  // from robot 'franka'".
  void add(std::shared_ptr<Sensor> sensor, std::string_view owner = "");
  // In order; the first clash throws, those before it stay added.
  void extend(std::span<const std::shared_ptr<Sensor>> sensors, std::string_view owner = "");

  // Keeps these alone, in this order. Throws KeyError for an unknown name, ValueError for one given
  // twice or once the suite is bound.
  void select(std::span<const std::string> names);

  std::span<const std::shared_ptr<Sensor>> sensors() const { return sensors_; }
  std::size_t size() const { return sensors_.size(); }
  std::vector<std::string> names() const;
  Sensor* find(std::string_view name) const;              // null if there is none
  Sensor& get(std::string_view name) const;               // throws KeyError with the nearest names
  const std::string& owner(std::string_view name) const;  // throws KeyError with the nearest names

  // Adds the sensors to the simulation, each once; those added later need another call. The
  // simulation lives longer.
  void bind(Simulation& simulation);
  // Makes every row current, in the worlds `ids`.
  void refresh(WorldIds ids = all_worlds);
  // Fields of all sensors in order: a sensor with several has several streams. Valid after bind().
  std::vector<const Field*> streams() const;
  const Field& stream(std::string_view name) const;  // throws KeyError with the nearest names

 private:
  int index(std::string_view name) const;  // -1 if there is none

  std::vector<std::shared_ptr<Sensor>> sensors_;
  std::vector<std::string> owners_;  // of each sensor: "task 'pick'"
  std::vector<Sensor*> bound_;       // a prefix of sensors_
  Simulation* simulation_ = nullptr;
};

}  // namespace mjsense
