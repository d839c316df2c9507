// SPDX-License-Identifier: Apache-2.0
#pragma once
// MuJoCo's own sensors. The row is the sensor's slice of mjData.sensordata as float32 [B, dim];
// what the numbers mean is in the table of builtin_types.h and in the field's SensorSpec.

#include <array>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/sensor_fields.h"
#include "mjsense/scene/entity.h"
#include "mjsense/scene/model_sensors/model_sensor.h"

namespace mjsense {

enum class BuiltinInterp { kZoh, kLinear, kCubic };
template <>
inline constexpr std::array<std::string_view, 3> kWords<BuiltinInterp>{"zoh", "linear", "cubic"};
template <>
inline constexpr std::array<std::string_view, 4> kWords<mjtDataType>{"real", "positive", "axis",
                                                                     "quaternion"};
enum class BuiltinStage { kPos, kVel, kAcc };
template <>
inline constexpr std::array<std::string_view, 3> kWords<BuiltinStage>{"pos", "vel", "acc"};

struct BuiltinSensorCfg : SensorCfg {
  std::string sensor_type;
  ObjRef obj, ref;
  double cutoff = 0.0;
  double delay = 0.0;
  double interval = 0.0;
  double phase = 0.0;
  int nsample = 0;
  Word<BuiltinInterp> interp;
  double noise = 0.0;
  std::vector<std::string> data{"dist"};
  bool enclosed = false;
  int dim = 0;
  Word<mjtDataType> datatype;
  Word<BuiltinStage> needstage = BuiltinStage::kAcc;
  std::string plugin, instance;

  // Throws ValueError for everything that can be known without a model.
  void validate() const;
  std::unique_ptr<Sensor> build() const override;
  std::string key() const override;  // "entity/name" if obj has an entity
};

inline constexpr std::array<std::string_view, 6> kRangeFields{"dist",  "dir",    "origin",
                                                              "point", "normal", "depth"};

template <class V>
void visit_fields(V& v, BuiltinSensorCfg& c) {
  v.object("BuiltinSensorCfg",
           "One of MuJoCo's own sensors; ``data`` is float32 ``[B, dim]``. Registered as "
           "``entity/name``.",
           "builtin");
  v.extends(static_cast<SensorCfg&>(c));
  v("sensor_type", c.sensor_type,
    "accelerometer, gyro, framepos, jointpos, rangefinder and so on: the MJCF name.");
  v("obj", c.obj, "What is measured.").or_none();
  v("ref", c.ref,
    "Frame in which a frame sensor's value is expressed, the world without one; the second object "
    "of "
    "camprojection, insidesite, distance, normal, fromto, tactile.")
      .or_none();
  v("cutoff", c.cutoff,
    "Positive: every component is limited to [-cutoff, cutoff] (a rangefinder's -1 too). Distance, "
    "normal and fromto: the largest distance that is looked for, m.");
  v("delay", c.delay, "Between a reading and its showing. Needs nsample.").unit("s").at_least(0);
  v("interval", c.interval, "Between readings; 0: every physics step. Needs nsample.")
      .unit("s")
      .at_least(0);
  v("phase", c.phase, "When readings are taken, in (-interval, 0].").unit("s").at_most(0);
  v("nsample", c.nsample, "Readings kept, newest first, in the field ``history``.").at_least(0);
  v("interp", c.interp, "What is read between readings.");
  v("noise", c.noise, "Standard deviation; stored in the model, never applied by MuJoCo.")
      .at_least(0);
  v("data", c.data, "Rangefinder: what of each ray, in this order.").one_of(kRangeFields);
  v("enclosed", c.enclosed, "insidesite: by how much the whole object juts out, m.");
  v("dim", c.dim, "User sensors: numbers in a row.").at_least(0);
  v("datatype", c.datatype, "User sensors: what the numbers are.");
  v("needstage", c.needstage, "User sensors: what must be computed before.");
  v("plugin", c.plugin, "Plugin sensors: identifier.");
  v("instance", c.instance, "Plugin sensors: full name of an instance in an entity's XML.");
}

// Fields: "" float32 [dim]; with a history (nsample > 0) also "history" float32 [nsample, dim], the
// samples taken so far, undelayed, newest first (0 before the first).
// Writes one of MuJoCo's own sensors into the spec; its rows are a ModelSensor's.
class BuiltinSensor : public ModelSensor {
 public:
  explicit BuiltinSensor(const BuiltinSensorCfg& cfg);
  void edit_spec(mjSpec* spec) override;

 private:
  std::unique_ptr<const BuiltinSensorCfg> cfg_;
};

}  // namespace mjsense
