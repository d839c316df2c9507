// SPDX-License-Identifier: Apache-2.0
#include "mjsense/observe/suite.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::observe {

void SensorSuite::add(std::shared_ptr<Sensor> sensor, std::string_view owner) {
  const std::string from = owner.empty() ? "the suite" : std::string(owner);
  if (sensor->name().empty()) throw ValueError(fmt::format("a sensor from {} has no name", from));
  if (const int other = index(sensor->name()); other >= 0) {
    throw ValueError(fmt::format("'{}' is a duplicated sensor uuid: from {} and from {}",
                                 sensor->name(), owners_[other], from));
  }
  sensors_.push_back(std::move(sensor));
  owners_.push_back(from);
}

void SensorSuite::extend(std::span<const std::shared_ptr<Sensor>> sensors, std::string_view owner) {
  for (const auto& sensor : sensors) add(sensor, owner);
}

void SensorSuite::select(std::span<const std::string> names) {
  if (simulation_) throw ValueError("a suite that is bound to a simulation cannot be changed");
  std::vector<std::shared_ptr<Sensor>> sensors;
  std::vector<std::string> owners;
  for (const std::string& name : names) {
    const int i = index(name);
    if (i < 0) throw_unknown("suite", "sensor", name, this->names());
    if (std::ranges::find(sensors, sensors_[i]) != sensors.end()) {
      throw ValueError(fmt::format("suite: sensor '{}' is given twice", name));
    }
    sensors.push_back(sensors_[i]);
    owners.push_back(owners_[i]);
  }
  sensors_ = std::move(sensors);
  owners_ = std::move(owners);
}

int SensorSuite::index(std::string_view name) const {
  for (std::size_t i = 0; i < sensors_.size(); ++i) {
    if (sensors_[i]->name() == name) return static_cast<int>(i);
  }
  return -1;
}

std::vector<std::string> SensorSuite::names() const {
  return names_of(sensors_, [](const auto& sensor) { return sensor->name(); });
}

Sensor* SensorSuite::find(std::string_view name) const {
  const int i = index(name);
  return i < 0 ? nullptr : sensors_[i].get();
}

Sensor& SensorSuite::get(std::string_view name) const {
  if (Sensor* sensor = find(name)) return *sensor;
  throw_unknown("suite", "sensor", name, names());
}

const std::string& SensorSuite::owner(std::string_view name) const {
  if (const int i = index(name); i >= 0) return owners_[i];
  throw_unknown("suite", "sensor", name, names());
}

void SensorSuite::bind(sim::Simulation& simulation) {
  if (simulation_ && simulation_ != &simulation) {
    throw ValueError("a suite belongs to one simulation; this one is bound to another");
  }
  simulation_ = &simulation;
  while (bound_.size() < sensors_.size()) {
    simulation.add(sensors_[bound_.size()]);
    bound_.push_back(sensors_[bound_.size()].get());
  }
}

void SensorSuite::refresh(worlds::WorldIds ids) {
  if (!simulation_ || bound_.size() < sensors_.size()) {
    throw ValueError("the suite has sensors that are not bound to a simulation: call bind()");
  }
  simulation_->refresh(bound_, ids);
}

std::vector<const Field*> SensorSuite::streams() const {
  std::vector<const Field*> streams;
  for (const auto& sensor : sensors_) {
    for (const Field& field : sensor->fields()) streams.push_back(&field);
  }
  return streams;
}

const Field& SensorSuite::stream(std::string_view name) const {
  const auto stream_name = [](const Field* field) -> const std::string& {
    return field->spec.name;
  };
  return *find_named(streams(), stream_name, name, "suite", "stream");
}

}  // namespace mjsense::observe
