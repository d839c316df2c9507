// SPDX-License-Identifier: Apache-2.0
#pragma once
// MuJoCo's own sensors. A row is the sensor's slice of mjData.sensordata as float32 [B, dim]. The
// meaning of the values is in the table of builtin_types.h and in the field's SensorSpec.

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/sensor.h"
#include "mjsense/scene/entity.h"
#include "mjsense/scene/model_sensors/model_sensor.h"

namespace mjsense {
template <>
inline constexpr std::array<std::string_view, 4> kEnumNames<mjtDataType>{"real", "positive", "axis",
                                                                         "quaternion"};
}  // namespace mjsense

namespace mjsense::sensors {

enum class BuiltinInterp { kZoh, kLinear, kCubic };
constexpr std::array<std::string_view, 3> enum_names(BuiltinInterp) {
  return {"zoh", "linear", "cubic"};
}
enum class BuiltinStage { kPos, kVel, kAcc };
constexpr std::array<std::string_view, 3> enum_names(BuiltinStage) { return {"pos", "vel", "acc"}; }

struct BuiltinSensorCfg : SensorCfg {
  std::string sensor_type;
  scene::ObjRef obj, ref;
  double cutoff = 0.0;
  double delay = 0.0;
  double interval = 0.0;
  double phase = 0.0;
  int nsample = 0;
  NamedEnum<BuiltinInterp> interp;
  double noise = 0.0;
  std::vector<std::string> data{"dist"};
  bool enclosed = false;
  int dim = 0;
  NamedEnum<mjtDataType> datatype;
  NamedEnum<BuiltinStage> needstage = BuiltinStage::kAcc;
  std::string plugin, instance;

  // Throws ValueError for errors that can be found without a model.
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
    "MJCF name of the sensor type: accelerometer, gyro, framepos, jointpos, rangefinder and so "
    "on.");
  v("obj", c.obj, "The element that is measured.").or_none();
  v("ref", c.ref,
    "Reference frame of a frame sensor, the world by default; the second object of camprojection, "
    "insidesite, distance, normal, fromto and tactile.")
      .or_none();
  v("cutoff", c.cutoff,
    "If positive, every component is clipped to [-cutoff, cutoff] (the -1 of a rangefinder too). "
    "For distance, normal and fromto: the maximum distance that is searched, m.");
  v("delay", c.delay, "Delay of the readings. Requires nsample.").unit("s").at_least(0);
  v("interval", c.interval,
    "Time between readings; 0: one reading per physics step. Requires nsample.")
      .unit("s")
      .at_least(0);
  v("phase", c.phase, "Time offset of the readings, in (-interval, 0].").unit("s").at_most(0);
  v("nsample", c.nsample, "Number of readings kept in the field ``history``, newest first.")
      .at_least(0);
  v("interp", c.interp, "Interpolation between readings.");
  v("noise", c.noise,
    "Standard deviation of the noise; it is stored in the model, but MuJoCo does not apply it.")
      .at_least(0);
  v("data", c.data, "Rangefinder: the quantities reported for each ray, in this order.")
      .one_of(kRangeFields);
  v("enclosed", c.enclosed, "insidesite: report by how much the whole object protrudes, m.");
  v("dim", c.dim, "User sensors: number of values in a row.").at_least(0);
  v("datatype", c.datatype, "User sensors: type of the values.");
  v("needstage", c.needstage, "User sensors: the last stage of the computation that they require.");
  v("plugin", c.plugin, "Plugin sensors: identifier of the plugin.");
  v("instance", c.instance, "Plugin sensors: full name of a plugin instance in an entity's XML.");
}

// Fields: "" float32 [dim]; with a history (nsample > 0) also "history" float32 [nsample, dim], the
// samples taken so far, without delay, newest first (0 before the first).
//
// The class adds one of MuJoCo's own sensors to the spec; its base class ModelSensor fills the
// rows.
class BuiltinSensor : public scene::ModelSensor {
 public:
  explicit BuiltinSensor(const BuiltinSensorCfg& cfg);
  void edit_spec(mjSpec* spec) override;

 private:
  std::unique_ptr<const BuiltinSensorCfg> cfg_;
};

}  // namespace mjsense::sensors
