#include "python/bindings/configs.h"

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
