// SPDX-License-Identifier: Apache-2.0
#pragma once
// Options of physically based images, as the renderer needs them.

#include "mjsense/render/view/physical_light.h"
#include "mjsense/sensors/camera/image_cfg.h"

namespace mjsense::sensors {

render::PhysicalOptions physical_options(const RgbCfg& cfg, const mjModel* model);

}  // namespace mjsense::sensors
