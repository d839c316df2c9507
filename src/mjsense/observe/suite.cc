#include "mjsense/observe/suite.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/sim/simulation.h"

namespace mjsense {

void SensorSuite::add(std::shared_ptr<Sensor> sensor, std::string_view owner) {
  Sensor* raw = sensor.get();
  insert({.name = raw->name(),
          .sensor = raw,
          .owned = std::move(sensor),
          .owner = std::string(owner)});
}

void SensorSuite::extend(std::span<const std::shared_ptr<Sensor>> sensors, std::string_view owner) {
  for (const auto& sensor : sensors) add(sensor, owner);
}

void SensorSuite::add_field(std::string name, Sensor& scene_sensor, std::string_view field,
                            std::string_view owner, std::optional<SensorSpec> spec) {
  insert({.name = std::move(name),
          .sensor = &scene_sensor,
          .field = std::string(field),
          .spec = std::move(spec),
          .owner = std::string(owner)});
}

void SensorSuite::insert(Entry added) {
  if (added.name.empty()) {
    throw ValueError(
        fmt::format("a sensor of {} has no name", added.owner.empty() ? "the suite" : added.owner));
  }
  if (const Entry* other = entry(added.name)) {
    auto from = [](const Entry& e) { return e.owner.empty() ? std::string("the suite") : e.owner; };
    throw ValueError(fmt::format("'{}' is duplicated sensor uuid: from {} and from {}", added.name,
                                 from(*other), from(added)));
  }
  entries_.push_back(std::move(added));
  streams_.clear();
}

const SensorSuite::Entry* SensorSuite::entry(std::string_view name) const {
  const auto it = std::ranges::find(entries_, name, &Entry::name);
  return it == entries_.end() ? nullptr : &*it;
}

std::vector<std::string> SensorSuite::names() const {
  std::vector<std::string> names;
  for (const Entry& e : entries_) names.push_back(e.name);
  return names;
}

Sensor* SensorSuite::find(std::string_view name) const {
  const Entry* e = entry(name);
  return e ? e->sensor : nullptr;
}

Sensor& SensorSuite::get(std::string_view name) const {
  if (Sensor* sensor = find(name)) return *sensor;
  throw_unknown("suite", "sensor", name, names());
}

const std::string& SensorSuite::owner(std::string_view name) const {
  if (const Entry* e = entry(name)) return e->owner;
  throw_unknown("suite", "sensor", name, names());
}

void SensorSuite::bind(Simulation& simulation) {
  if (simulation_ && simulation_ != &simulation) {
    throw ValueError("a suite belongs to one simulation; this one is bound to another");
  }
  simulation_ = &simulation;
  streams_.clear();
  sensors_.clear();
  for (Entry& e : entries_) {
    if (!e.bound && e.owned) simulation.add(e.owned);
    e.bound = true;
    if (e.field) e.sensor->field(*e.field);  // throws if there is none
    if (std::ranges::find(sensors_, e.sensor) == sensors_.end()) sensors_.push_back(e.sensor);
    for (Field& field : e.sensor->fields()) {
      if (e.field && field.name != *e.field) continue;
      Stream stream{e.spec.value_or(field.spec), {}, e.sensor};
      if (e.field) stream.spec.name = e.name;
      if (stream.row_bytes() != field.data.row_bytes()) {
        throw ValueError(fmt::format("suite: '{}' declares {} {}, but '{}' has {} {}", e.name,
                                     dtype_name(stream.spec.dtype), stream.spec.shape.str(),
                                     field.spec.name, dtype_name(field.spec.dtype),
                                     field.spec.shape.str()));
      }
      stream.data = ArrayView::dense(field.data.data(), stream.spec.dtype,
                                     stream.spec.shape.with_front(field.data.shape()[0]));
      streams_.push_back(std::move(stream));
    }
  }
}

void SensorSuite::refresh() {
  if (!simulation_) throw ValueError("the suite is not bound to a simulation: call bind() first");
  simulation_->refresh(sensors_);
}

std::span<const Stream> SensorSuite::streams() const {
  if (streams_.empty() && !entries_.empty()) {
    throw ValueError("the suite has sensors that are not bound to a simulation: call bind() first");
  }
  return streams_;
}

const Stream& SensorSuite::stream(std::string_view name) const {
  std::vector<std::string> names;
  for (const Stream& s : streams()) {
    if (s.spec.name == name) return s;
    names.push_back(s.spec.name);
  }
  throw_unknown("suite", "stream", name, names);
}

std::size_t SensorSuite::bytes_per_world() const {
  std::size_t bytes = 0;
  for (const Stream& s : streams()) bytes += s.row_bytes();
  return bytes;
}

}  // namespace mjsense
