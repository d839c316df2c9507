// SPDX-License-Identifier: Apache-2.0
#pragma once
// TerrainHeightSensor: height of frames (feet, a base) above the surface below them. It is a
// RayCastSensor with one more field:
//   heights  float32 [B, F] m (reduction min, max, mean) or [B, F, n] m (none)
//
// A ray that hits gives frame z - hit z, or 0 if it hits the underside of a surface (the frame is
// inside something). A ray that misses gives max_distance. If all rays of a frame miss, the height
// is measured to the ground straight below, at any distance. If there is none below, it is measured
// to the ground above, which gives 0. The result is limited to [0, max_distance]. If there is no
// ground at all, the world's z = 0 is used.

#include <array>
#include <memory>
#include <string_view>

#include "mjsense/sensors/raycast/raycast_sensor_cfg.h"

namespace mjsense::sensors {

enum class HeightReduction { kMin, kMax, kMean, kNone };
constexpr std::array<std::string_view, 4> enum_names(HeightReduction) {
  return {"min", "max", "mean", "none"};
}

struct TerrainHeightSensorCfg : RayCastSensorCfg {
  NamedEnum<HeightReduction> reduction;

  std::unique_ptr<Sensor> build() const override;
};
template <class V>
void visit_fields(V& v, TerrainHeightSensorCfg& c) {
  v.object("TerrainHeightSensorCfg",
           "Height of frames above the surface below them. ``data.heights`` is float32 ``[B, F]``, "
           "or ``[B, F, n]`` without reduction.",
           "terrain_height");
  v.extends(static_cast<RayCastSensorCfg&>(c));
  v("reduction", c.reduction, "Reduction over the rays of a frame.");
}

}  // namespace mjsense::sensors
