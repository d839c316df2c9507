#include "python/bindings/configs.h"

#include <map>
#include <utility>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense::python {

std::span<const CfgKind> cfg_kinds() {
  static const std::vector<CfgKind> kinds = {
      // clang-format off: one line a sensor
      builtin_kind(), camera_kind(), contact_kind(), effect_kind(),
      imu_kind(),     lidar_kind(),  raycast_kind(), terrain_height_kind(),
      // clang-format on
  };
  return kinds;
}

namespace {

std::map<std::string, CfgCheck>& cfg_checks() {
  static std::map<std::string, CfgCheck> checks = {
      {"SensorCfg", [](nb::handle config) { read_sensor_cfg(config)->build(); }}};
  return checks;
}

}  // namespace

void add_cfg_check(std::string python_class, CfgCheck check) {
  cfg_checks()[std::move(python_class)] = std::move(check);
}

void check_cfg(nb::handle config) {
  for (nb::handle base : config.type().attr("__mro__")) {
    const auto found = cfg_checks().find(nb::cast<std::string>(base.attr("__name__")));
    if (found != cfg_checks().end()) return found->second(config);
  }
}

std::shared_ptr<SensorCfg> read_sensor_cfg(nb::handle config) {
  nb::object kind = nb::getattr(config, "kind", nb::none());
  if (nb::isinstance<nb::str>(kind)) {
    const auto name = nb::cast<std::string>(kind);
    for (const CfgKind& known : cfg_kinds()) {
      if (name == known.name) return known.read(config);
    }
  }
  const std::string text = "not a sensor configuration: " + nb::cast<std::string>(nb::repr(config));
  throw nb::type_error(text.c_str());
}

}  // namespace mjsense::python
