#pragma once
// The list of sensor configurations that Python knows. Each is read in
// sensors/x.cc.

#include <nanobind/nanobind.h>

#include <functional>
#include <memory>
#include <span>
#include <string>

#include "mjsense/core/sensor.h"
#include "mjsense/scene/entity.h"
#include "python/bindings/reader.h"

namespace mjsense::python {

struct CfgKind {
  const char* name;  // the class attribute `kind` of the Python dataclass
  std::shared_ptr<SensorCfg> (*read)(nb::handle config);
  nb::dict (*defaults)();
};

template <class Cfg>
CfgKind cfg_kind(const char* name) {
  return {name,
          [](nb::handle config) -> std::shared_ptr<SensorCfg> {
            auto cfg = std::make_shared<Cfg>();
            FromPython reader(config);
            fields(reader, *cfg);
            return cfg;
          },
          [] {
            Cfg cfg;
            ToPython writer;
            fields(writer, cfg);
            return writer.values;
          }};
}

// One line for each sensor, here and in configs.cc.
CfgKind builtin_kind();
CfgKind camera_kind();
CfgKind contact_kind();
CfgKind imu_kind();
CfgKind lidar_kind();
CfgKind effect_kind();
CfgKind raycast_kind();
CfgKind terrain_height_kind();

std::span<const CfgKind> cfg_kinds();

// Throws TypeError for an object that is no sensor configuration.
std::shared_ptr<SensorCfg> read_sensor_cfg(nb::handle config);

// Objects of this Python class (or of one below it) are checked so when they are made: mjsense._core.check_cfg.
using CfgCheck = std::function<void(nb::handle config)>;
void add_cfg_check(std::string python_class, CfgCheck check);
void check_cfg(nb::handle config);

// By the C++ configuration's own validate(cfg, place).
template <class Cfg>
void add_cfg_check(const char* python_class) {
  add_cfg_check(python_class, [python_class](nb::handle config) {
    Cfg cfg;
    FromPython reader(config);
    fields(reader, cfg);
    validate(cfg, python_class);
  });
}

template <class Fields>
void fields(Fields& f, ObjRef& ref) {
  f("type", ref.type);
  f("name", ref.name);
  f("entity", ref.entity);
}

}  // namespace mjsense::python
