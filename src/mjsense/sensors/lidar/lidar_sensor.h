// SPDX-License-Identifier: Apache-2.0
#pragma once
// The sensor that LidarSensorCfg builds.

#include <array>
#include <string_view>
#include <vector>

#include "mjsense/sensors/lidar/lidar_sensor_cfg.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"

namespace mjsense::sensors {

class LidarSensor : public RayCastSensor {
 public:
  explicit LidarSensor(const LidarSensorCfg& cfg);
  std::string_view kind() const override { return "lidar"; }
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;

 protected:
  RayPattern build_pattern(const mjModel* model) const override;
  int num_parts() const override { return num_parts_; }
  int part(const World& world) const override;
  void traced(const rays::RayScene& rays, int world, int frame, const RayBundle& bundle, int p,
              const rays::RayPacket& packet, const rays::HitPacket& hits) override;
  bool wants_finish() const override { return disturbed_; }
  void finish(const rays::RayScene& rays, int world, rays::RayScratch& scratch) override;

 private:
  void read_table(const TableScan& scan);
  RayPattern spinning(const SpinningScan& scan) const;
  RayPattern table(const TableScan& scan) const;
  void origin(int world, int r, float out[3]) const;  // of ray r, m, world

  LidarSensorCfg lidar_;
  std::vector<std::array<double, 2>> angles_;  // of a table scan
  int num_parts_ = 1;
  bool disturbed_;  // there is noise, rounding or dropout
  double rate_hz_;
  std::vector<Rng> noise_;  // [B]
  // [B, N, 3] m, world: origins of the rays, if there is noise and rays start at different times.
  Array origins_;
  Field *points_ = nullptr, *intensity_ = nullptr;
};

}  // namespace mjsense::sensors
