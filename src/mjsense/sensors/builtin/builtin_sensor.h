#pragma once
// MuJoCo's own sensors. The row is the sensor's slice of mjData.sensordata as float32 [B, dim];
// what the numbers mean is in the table of builtin_types.h and in the field's SensorSpec.

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/scene/entity.h"

namespace mjsense {

struct BuiltinSensorCfg : SensorCfg {
  std::string sensor_type;  // as in MJCF: "accelerometer", "framepos", "rangefinder" ...
  ObjRef obj;               // what it is attached to
  ObjRef ref;               // the frame it is relative to; the second object of camprojection,
                            // insidesite, distance, normal, fromto, tactile
  // > 0 clamps every number to [-cutoff, cutoff], a rangefinder's -1 too. Distance, normal and
  // fromto: the largest distance (m) that is looked for.
  double cutoff = 0.0;

  // Sampling and latency, with MuJoCo's meaning. A reading is taken every `interval` (s; 0: every
  // physics step) at the phase in (-interval, 0], and shows `delay` seconds (0: none) later. Both
  // need nsample > 0, the length of the history. What is read between samples: zoh, linear or
  // cubic.
  double delay = 0.0;
  double interval = 0.0;
  double phase = 0.0;
  int nsample = 0;
  std::string interp = "zoh";

  double noise = 0.0;  // standard deviation, stored in the model, never applied by MuJoCo

  // rangefinder: its fields, in this order of dist dir origin point normal depth; one set a ray.
  std::vector<std::string> data{"dist"};
  bool enclosed = false;          // insidesite: by how much the whole object juts out, m
  int dim = 0;                    // user
  std::string datatype = "real";  // user: real positive axis quaternion
  std::string needstage = "acc";  // user: pos vel acc
  std::string plugin;             // plugin: its identifier ...
  std::string instance;           // ... or the full name of an instance in an entity's XML

  // Throws ValueError for everything that can be known without a model.
  void validate() const;
  std::unique_ptr<Sensor> build() const override;
  std::string key() const override;  // "entity/name" if obj has an entity
};

// Fields: "" float32 [dim]; with a history (nsample > 0) also "history" float32 [nsample, dim], the
// samples taken so far, undelayed, newest first (0 before the first).
class BuiltinSensor : public Sensor {
 public:
  // Found in the model under its name.
  explicit BuiltinSensor(std::string name) : Sensor(std::move(name)) {}
  explicit BuiltinSensor(const BuiltinSensorCfg& cfg);

  std::string_view kind() const override { return "builtin"; }
  void edit_spec(mjSpec* spec) override;
  void initialize(const SensorInit& init) override;
  mjtStage needs() const override { return needs_; }
  void compute(const World& world) override;
  void draw(const World& world, DebugShapes& shapes) override;  // the frame it is attached to

 private:
  std::unique_ptr<const BuiltinSensorCfg> cfg_;  // null if found in the model
  int id_ = -1;
  int adr_ = 0, dim_ = 0;
  mjtStage needs_ = mjSTAGE_ACC;
  int history_adr_ = -1, nsample_ = 0;
  Field* field_ = nullptr;
  Field* history_ = nullptr;
};

}  // namespace mjsense
