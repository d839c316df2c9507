// SPDX-License-Identifier: Apache-2.0
#pragma once
// The sensor that TerrainHeightSensorCfg builds.

#include <string_view>

#include "mjsense/sensors/raycast/raycast_sensor.h"
#include "mjsense/sensors/terrain_height/terrain_height_sensor_cfg.h"

namespace mjsense::sensors {

class TerrainHeightSensor : public RayCastSensor {
 public:
  explicit TerrainHeightSensor(const TerrainHeightSensorCfg& cfg);
  std::string_view kind() const override { return "terrain_height"; }
  void initialize(const SensorInit& init) override;

 protected:
  bool wants_finish() const override { return true; }
  void finish(const rays::RayScene& rays, int world, rays::RayScratch& scratch) override;

 private:
  float height_without_hits(const rays::RayScene& rays, int world, int frame,
                            rays::RayScratch& scratch) const;

  HeightReduction reduction_;
  Field* heights_ = nullptr;
};

}  // namespace mjsense::sensors
