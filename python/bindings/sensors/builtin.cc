// BuiltinSensorCfg in Python.

#include "mjsense/sensors/builtin/builtin_sensor.h"
#include "python/bindings/configs.h"

namespace mjsense::python {
template <class Fields>
void fields(Fields& f, BuiltinSensorCfg& c) {
  f("name", c.name);
  f("sensor_type", c.sensor_type);
  f("obj", c.obj);
  f("ref", c.ref);
  f("cutoff", c.cutoff);
  f("delay", c.delay);
  f("interval", c.interval);
  f("phase", c.phase);
  f("nsample", c.nsample);
  f("interp", c.interp);
  f("noise", c.noise);
  f("data", c.data);
  f("enclosed", c.enclosed);
  f("dim", c.dim);
  f("datatype", c.datatype);
  f("needstage", c.needstage);
  f("plugin", c.plugin);
  f("instance", c.instance);
}

CfgKind builtin_kind() { return cfg_kind<BuiltinSensorCfg>("builtin"); }

}  // namespace mjsense::python
