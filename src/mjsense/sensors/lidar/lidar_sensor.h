#pragma once
// LidarSensor: a RayCastSensor whose rays are a lidar's, with its noise, its returns' intensity and
// its point cloud.
//
// All fields of RayCastSensor (geom_id and its kin always), and
//   points      float32 [B, N, 3]  m, sensor frame, as the device reports them; 0: no return
//   intensity   float32 [B, N]     0..1: the surface's albedo times the cosine of incidence
// Noise is in distances, points and hit_pos_w alike. Ray order: a spinning lidar's is
// [channels, samples], row-major, the first channel first; a table's is its own.

#include <array>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "mjsense/sensors/raycast/raycast_sensor.h"

namespace mjsense {

// `channels` lasers over each other turn about the frame's z axis, counter-clockwise, from
// azimuth_start; one reading is one sweep, the last firing now.
struct SpinningScan {
  int channels = 16;
  double elevation_min_deg = -15.0, elevation_max_deg = 15.0;  // evenly spaced, the lowest first
  std::vector<double> elevations_deg;  // or one elevation a channel, in this order
  int samples = 360;                   // firings of each channel in a sweep
  double azimuth_start_deg = 0.0, azimuth_span_deg = 360.0;  // 0: along +x
  double rate_hz = 10.0;                                     // sweeps a second
};

// Rays from a table of (azimuth, elevation) in radians: solid-state lidars, or a pattern that does
// not repeat within a reading.
struct TableScan {
  std::string file;  // .npy of shape (M, 2), such as mujoco-lidar's Livox tables
  std::vector<std::array<double, 2>> angles;  // or the table itself
  // Rows that a scan takes, the next ones at the next scan; 0: all. Rows left over at the end are
  // not used.
  int rays_per_scan = 0;
  double rate_hz = 10.0;  // scans a second
};

// Throw ValueError; what a table's file holds is read by the sensor.
void validate(const SpinningScan& scan, std::string_view place);
void validate(const TableScan& scan, std::string_view place);

// `pattern` is not for lidars, and hit ids are always there.
struct LidarSensorCfg : RayCastSensorCfg {
  LidarSensorCfg() {
    max_distance = 100.0;
    min_distance = 0.1;
  }
  std::variant<SpinningScan, TableScan> scan;
  // Each ray leaves from where the frame was at its own moment of the sweep.
  bool motion_distortion = false;
  double range_noise_std = 0.0;       // m
  double range_noise_relative = 0.0;  // standard deviation in parts of the range, added in squares
  double range_resolution = 0.0;      // m, distances are rounded to multiples; 0: not at all
  double dropout = 0.0;               // probability that a return is lost

  std::unique_ptr<Sensor> build() const override;
};

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
  void traced(const RayScene& rays, int world, int frame, const RayBundle& bundle, int p,
              const RayPacket& packet, const HitPacket& hits) override;
  bool wants_finish() const override { return disturbed_; }
  void finish(const RayScene& rays, int world, RayScratch& scratch) override;

 private:
  void read_table(const TableScan& scan);
  RayPattern spinning(const SpinningScan& scan) const;
  RayPattern table(const TableScan& scan) const;
  void origin(int world, int r, float out[3]) const;  // of ray r, m, world

  LidarSensorCfg lidar_;
  std::vector<std::array<double, 2>> angles_;  // of a table
  int num_parts_ = 1;
  bool disturbed_;  // by noise, rounding or loss
  double rate_hz_;
  std::vector<Rng> noise_;  // [B]
  Array origins_;  // [B, N, 3] m, world: of rays that noise moves and that left at different times
  Field *points_ = nullptr, *intensity_ = nullptr;
};

}  // namespace mjsense
