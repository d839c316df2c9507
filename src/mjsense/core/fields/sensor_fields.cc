// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/sensor_fields.h"

namespace mjsense {

std::shared_ptr<SensorCfg> SensorKind::make(void** fields) const {
  *fields = cfg->create();
  return std::shared_ptr<SensorCfg>(base(*fields));
}

}  // namespace mjsense
