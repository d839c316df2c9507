// ImuSensorCfg in Python.

#include <nanobind/nanobind.h>

#include "mjsense/sensors/imu/imu_sensor.h"
#include "python/bindings/bindings.h"
#include "python/bindings/configs.h"

namespace mjsense::python {

void read_custom(FromPython&, nb::handle value,
                 std::shared_ptr<const Effect>& out);  // effects.cc

template <class Fields>
void fields(Fields& f, ImuModel::Axis& c) {
  f("noise_density", c.noise_density);
  f("bias_tolerance", c.bias_tolerance);
  f("scale_tolerance", c.scale_tolerance);
  f("cross_axis_tolerance", c.cross_axis_tolerance);
  f("range", c.range);
  f("resolution", c.resolution);
  f("bias_drift", c.bias_drift);
  f("bias_drift_time_s", c.bias_drift_time_s);
}
template <class Fields>
void fields(Fields& f, ImuModel& c) {
  f("accelerometer", c.accelerometer);
  f("gyroscope", c.gyroscope);
}
template <class Fields>
void fields(Fields& f, ImuSensorCfg& c) {
  f("name", c.name);
  f("site", c.site);
  f("preset", c.preset);
  f("model", c.model);
  f("orientation", c.orientation);
  f("effects", c.effects);
}

void bind_imu(nb::module_&) {
  add_cfg_check<ImuModel::Axis>("ImuAxis");
  add_cfg_check<ImuModel>("ImuModel");
}

CfgKind imu_kind() { return cfg_kind<ImuSensorCfg>("imu"); }

}  // namespace mjsense::python
