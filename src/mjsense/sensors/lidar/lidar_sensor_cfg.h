// SPDX-License-Identifier: Apache-2.0
#pragma once
// LidarSensor: a RayCastSensor with the rays of a lidar, its noise, the intensity of its returns,
// and its point cloud.
//
// It has all fields of RayCastSensor (geom_id, body_id and material_id always), and
//   points      float32 [B, N, 3]  m, sensor frame, as the device reports them; 0: no return
//   intensity   float32 [B, N]     0..1: the surface's albedo times the cosine of incidence
// The same noise is in distances, points and hit_pos_w. The ray order of a spinning lidar is
// [channels, samples], row-major, the first channel first. A table has its own order.

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "mjsense/sensors/raycast/raycast_sensor_cfg.h"

namespace mjsense::sensors {

// One reading is one sweep; the last firing is at the current time.
struct SpinningScan {
  int channels = 16;
  double elevation_min_deg = -15.0, elevation_max_deg = 15.0;
  std::vector<double> elevations_deg;
  int samples = 360;
  double azimuth_start_deg = 0.0, azimuth_span_deg = 360.0;
  double rate_hz = 10.0;
};
template <class V>
void visit_fields(V& v, SpinningScan& c) {
  v.object("SpinningScanCfg",
           "Stacked lasers that rotate about the frame's z axis; rays are ``[channels, samples]``.",
           "spinning")
      .frozen();
  v("channels", c.channels, "Number of lasers.").at_least(1);
  v("elevation_min_deg", c.elevation_min_deg, "Elevation of channel 0 above the xy plane.")
      .within(-90, 90)
      .flag("low");
  v("elevation_max_deg", c.elevation_max_deg,
    "Elevation of the last channel; the others are evenly spaced in between.")
      .within(-90, 90)
      .flag("high");
  v("elevations_deg", c.elevations_deg, "Elevation of each channel, instead of evenly spaced ones.")
      .within(-90, 90);
  v("samples", c.samples, "Number of firings of each channel in a sweep.").at_least(1);
  v("azimuth_start_deg", c.azimuth_start_deg,
    "Azimuth of the first firing, counter-clockwise; 0: along +x.");
  v("azimuth_span_deg", c.azimuth_span_deg, "Angle that a sweep covers.").above(0).at_most(360);
  v("rate_hz", c.rate_hz, "Sweeps per second; used only with motion distortion.").positive();
}

struct TableScan {
  std::string file;
  std::vector<std::array<double, 2>> angles;
  int rays_per_scan = 0;
  double rate_hz = 10.0;
};
template <class V>
void visit_fields(V& v, TableScan& c) {
  v.object("TableScanCfg",
           "Rays from a table of (azimuth, elevation), rad: solid-state and non-repeating lidars.",
           "table")
      .frozen();
  v("file", c.file, "An .npy file of shape (M, 2), such as mujoco-lidar's Livox tables.")
      .flag("table");
  v("angles", c.angles, "The table itself, [M, 2].").unit("rad");
  v("rays_per_scan", c.rays_per_scan,
    "Rows used by one scan; the next scan uses the following rows. 0: all rows. Rows left over at "
    "the end are not used.")
      .at_least(0)
      .flag("rays");
  v("rate_hz", c.rate_hz, "Scans per second.").positive();
}

using ScanCfg = std::variant<SpinningScan, TableScan>;

}  // namespace mjsense::sensors

namespace mjsense {
template <>
inline constexpr const char* kChoiceName<sensors::ScanCfg> = "LidarScanCfg";
}  // namespace mjsense

namespace mjsense::sensors {

// Check fields that depend on each other. Throw ValueError. The sensor itself reads a table's file.
void validate(const SpinningScan& scan, std::string_view context);
void validate(const TableScan& scan, std::string_view context);

struct LidarSensorCfg : RayCastSensorCfg {
  LidarSensorCfg() {
    max_distance = 100.0;
    min_distance = 0.1;
    any_frame = true;
  }
  ScanCfg scan;
  bool motion_distortion = false;
  double range_noise_std = 0.0;
  double range_noise_relative = 0.0;
  double range_resolution = 0.0;
  double dropout = 0.0;

  std::unique_ptr<Sensor> build() const override;
};
template <class V>
void visit_fields(V& v, LidarSensorCfg& c) {
  v.object(
      "LidarSensorCfg",
      "A lidar with a spinning scan or a table of rays. ``data`` is a "
      ":class:`mjsense.sensors.RayCastData` "
      "with points and intensity. ``pattern`` does not apply, and hit ids are always reported.",
      "lidar");
  v.extends(static_cast<RayCastSensorCfg&>(c));
  v("scan", c.scan, "The scan pattern.");
  v("motion_distortion", c.motion_distortion,
    "Emit each ray from the pose that the frame had at that ray's moment of the sweep.");
  v("range_noise_std", c.range_noise_std, "Standard deviation of the distances.")
      .unit("m")
      .at_least(0);
  v("range_noise_relative", c.range_noise_relative,
    "Standard deviation as a fraction of the distance; the two variances are added.")
      .at_least(0);
  v("range_resolution", c.range_resolution,
    "Distances are rounded to multiples of this value; 0: no rounding.")
      .unit("m")
      .at_least(0);
  v("dropout", c.dropout, "Probability that a return is lost.").within(0, 1);
}

}  // namespace mjsense::sensors
