#pragma once
// An ordered set of sensors with unique names: what a policy observes and what a recording stores.
//
// Built in layers: the task's sensors, then the robot's, then the policy's. Each layer is named, so
// that a clash of names can say who brought both.

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense {

class Simulation;

// One typed buffer of the suite. spec.name is its name there.
struct Stream {
  SensorSpec spec;
  ArrayView data;  // [B, *spec.shape], current after refresh(); its address does not change
  Sensor* sensor;

  std::size_t row_bytes() const { return spec.shape.size() * dtype_size(spec.dtype); }
  const std::byte* row(int world) const { return data.data + world * row_bytes(); }
};

class SensorSuite {
 public:
  // Throws ValueError if the name is taken: "'qpos' is duplicated sensor uuid: from task 'pick' and
  // from robot 'franka'".
  void add(std::shared_ptr<Sensor> sensor, std::string_view owner = "");
  // In order; the first clash throws, those before it stay added.
  void extend(std::span<const std::shared_ptr<Sensor>> sensors, std::string_view owner = "");
  // One field of a sensor that is the scene's own, under a name of the suite: rows are shared, not
  // copied. Camera "wrist" shows its field "rgb" as stream "wrist" and its field "depth" as
  // "wrist_depth". `spec` replaces the field's where it is given; its rows must have as many bytes.
  void add_field(std::string name, Sensor& scene_sensor, std::string_view field,
                 std::string_view owner = "", std::optional<SensorSpec> spec = {});

  std::size_t size() const { return entries_.size(); }
  std::vector<std::string> names() const;
  Sensor* find(std::string_view name) const;              // null if there is none
  Sensor& get(std::string_view name) const;               // throws KeyError with the nearest names
  const std::string& owner(std::string_view name) const;  // throws KeyError

  // Adds the suite's sensors to the simulation, once each; sensors added later need another call.
  // The simulation must outlive the suite.
  void bind(Simulation& simulation);
  // Makes every row current.
  void refresh();
  // Streams in suite order; a sensor with several fields has several. Valid after bind(), until the
  // next add.
  std::span<const Stream> streams() const;
  const Stream& stream(std::string_view name) const;  // throws KeyError with the nearest names
  std::size_t bytes_per_world() const;

 private:
  struct Entry {
    std::string name;
    Sensor* sensor;
    std::shared_ptr<Sensor> owned;     // null for a sensor of the scene
    std::optional<std::string> field;  // only this one
    std::optional<SensorSpec> spec;    // in place of the field's
    std::string owner;
    bool bound = false;
  };
  void insert(Entry entry);
  const Entry* entry(std::string_view name) const;

  std::vector<Entry> entries_;
  std::vector<Stream> streams_;
  std::vector<Sensor*> sensors_;  // each once
  Simulation* simulation_ = nullptr;
};

}  // namespace mjsense
