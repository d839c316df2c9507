// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/lidar/lidar_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/core/text/counted.h"
#include "mjsense/sensors/lidar/npy.h"
#include "mjsense/sensors/raycast/raycast_data.h"

namespace mjsense::sensors {
namespace {

constexpr double kRadians = std::numbers::pi / 180;

std::array<double, 3> direction(double azimuth, double elevation) {
  return {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
          std::sin(elevation)};
}

}  // namespace

SensorKind lidar_kind() { return sensor_kind<LidarSensorCfg>(&kRayCastData); }

std::unique_ptr<Sensor> LidarSensorCfg::build() const {
  return std::make_unique<LidarSensor>(*this);
}

LidarSensor::LidarSensor(const LidarSensorCfg& cfg) : RayCastSensor(cfg), lidar_(cfg) {
  cfg_.hit_ids = true;  // intensity needs them
  exclude_world_ = false;
  if (cfg.pattern != PatternCfg(GridPattern{}))
    throw ValueError(context() + ": pattern does not apply to a lidar: use scan");
  check_fields(cfg, context());
  if (const auto* s = std::get_if<SpinningScan>(&cfg.scan)) {
    rate_hz_ = s->rate_hz;
  } else {
    const TableScan& t = std::get<TableScan>(cfg.scan);
    rate_hz_ = t.rate_hz;
    read_table(t);
  }
  disturbed_ = cfg.range_noise_std > 0 || cfg.range_noise_relative > 0 ||
               cfg.range_resolution > 0 || cfg.dropout > 0;
}

void validate(const SpinningScan& s, std::string_view context) {
  check_ray_count(static_cast<double>(s.channels) * s.samples, context);
  if (!s.elevations_deg.empty() && static_cast<int>(s.elevations_deg.size()) != s.channels)
    throw ValueError(
        fmt::format("{}: elevations_deg has {}, channels is {}: expected one per channel", context,
                    counted(s.elevations_deg.size(), "value"), s.channels));
}

namespace {

void check_rows(std::size_t rows, const TableScan& t, std::string_view context) {
  if (t.rays_per_scan > static_cast<int>(rows))
    throw ValueError(
        fmt::format("{}: rays_per_scan is {}: must be between 0 and the table's {} rows", context,
                    t.rays_per_scan, rows));
}

}  // namespace

void validate(const TableScan& t, std::string_view context) {
  if (!t.file.empty() && !t.angles.empty())
    throw ValueError(fmt::format("{}: the scan has a file and angles: give one of them", context));
  if (t.file.empty() && t.angles.empty())
    throw ValueError(
        fmt::format("{}: the scan's table has no rows: give a file or angles", context));
  if (t.file.empty()) check_rows(t.angles.size(), t, context);
}

void LidarSensor::read_table(const TableScan& t) {
  angles_ = t.file.empty() ? t.angles : read_npy_pairs(t.file, context());
  if (angles_.empty()) throw ValueError(context() + ": the scan's table has no rows");
  TableScan read = t;  // values of a file are checked like those of a table
  read.file.clear();
  read.angles = angles_;
  check_fields(read, context());
  const int rows = static_cast<int>(angles_.size());
  if (t.rays_per_scan > 0) num_parts_ = rows / t.rays_per_scan;
  angles_.resize(t.rays_per_scan > 0 ? num_parts_ * t.rays_per_scan : rows);
}

RayPattern LidarSensor::build_pattern(const mjModel* /*model*/) const {
  RayPattern pattern = std::holds_alternative<SpinningScan>(lidar_.scan)
                           ? spinning(std::get<SpinningScan>(lidar_.scan))
                           : table(std::get<TableScan>(lidar_.scan));
  pattern.offsets.assign(pattern.directions.size(), {0, 0, 0});
  if (!lidar_.motion_distortion) pattern.times.clear();
  return pattern;
}

RayPattern LidarSensor::spinning(const SpinningScan& s) const {
  RayPattern pattern;
  for (int c = 0; c < s.channels; ++c) {
    const double even = s.channels > 1
                            ? s.elevation_min_deg +
                                  (s.elevation_max_deg - s.elevation_min_deg) * c / (s.channels - 1)
                            : 0.5 * (s.elevation_min_deg + s.elevation_max_deg);
    const double elevation = s.elevations_deg.empty() ? even : s.elevations_deg[c];
    for (int i = 0; i < s.samples; ++i) {
      const double azimuth = s.azimuth_start_deg + s.azimuth_span_deg * i / s.samples;
      pattern.directions.push_back(direction(azimuth * kRadians, elevation * kRadians));
      // A full turn takes 1 / rate, and a part of a turn takes that part of the time.
      pattern.times.push_back((i - (s.samples - 1)) * s.azimuth_span_deg /
                              (360 * s.samples * s.rate_hz));
    }
  }
  return pattern;
}

RayPattern LidarSensor::table(const TableScan& t) const {
  RayPattern pattern;
  const int count = static_cast<int>(angles_.size()) / num_parts_;
  for (std::size_t i = 0; i < angles_.size(); ++i) {
    pattern.directions.push_back(direction(angles_[i][0], angles_[i][1]));
    pattern.times.push_back((static_cast<int>(i) % count - (count - 1)) / (count * t.rate_hz));
  }
  return pattern;
}

// The last finished scan, which is cast as a whole.
int LidarSensor::part(const World& world) const {
  const auto scan = static_cast<std::int64_t>(std::floor(world.time() * rate_hz_ + 1e-6));
  return static_cast<int>(scan % num_parts_);
}

void LidarSensor::initialize(const SensorInit& init) {
  RayCastSensor::initialize(init);
  noise_.assign(init.num_worlds, Rng(0, 0, 0, 0));
  origins_ = {};
  if (disturbed_ && lidar_.motion_distortion)
    origins_ = Array(DType::kFloat32, {init.num_worlds, num_rays(), 3});
  const double far = cfg_.max_distance;
  points_ = &add("points", {num_rays(), 3}, "sensor", -far, far, init.num_worlds);
  intensity_ = &add("intensity", {num_rays()}, "", 0, 1, init.num_worlds);
}

void LidarSensor::compute(const World& world) {
  RayCastSensor::compute(world);
  noise_[world.id] = world.rng(stream_of(name()));
}

void LidarSensor::traced(const rays::RayScene& rays, int world, int frame, const RayBundle& bundle,
                         int p, const rays::RayPacket& packet, const rays::HitPacket& hits) {
  const int first = frame * num_rays_per_frame();
  rays::LidarReturns rows;
  rays.returns(world, bundle.packet(p), packet, hits, rows);
  float* points = points_->data.row<float>(world).data() + 3 * first;
  float* intensity = intensity_->data.row<float>(world).data() + first;
  bundle.each_run(p, [&](auto n, int lane, int ray) {
    copy_some<3 * n()>(rows.point + 3 * lane, points + 3 * ray);
    copy_some<n()>(rows.intensity + lane, intensity + ray);
  });
  if (origins_.empty()) return;
  float* origins = origins_.row<float>(world).data() + 3 * first;
  for (int i = 0; i < rays::kPacket; ++i) {
    const int r = bundle.rays(p)[i];
    if (r < 0) continue;
    for (int k = 0; k < 3; ++k)
      origins[3 * r + k] = static_cast<float>(packet.origin[k] + packet.o[k][i]);
  }
}

// Applies dropout, noise and rounding.
void LidarSensor::finish(const rays::RayScene& /*rays*/, int world, rays::RayScratch& /*scratch*/) {
  Rng& rng = noise_[world];
  float* distance = distances_->data.row<float>(world).data();
  float* hit = hit_pos_->data.row<float>(world).data();
  float* point = points_->data.row<float>(world).data();
  for (int r = 0; r < num_rays(); ++r) {
    // Every ray draws its numbers, whether it hits or not, so that its noise does not depend on the
    // other rays.
    const bool lost = lidar_.dropout > 0 && rng.uniform() < lidar_.dropout;
    const bool noisy = lidar_.range_noise_std > 0 || lidar_.range_noise_relative > 0;
    const double draw = noisy ? rng.normal() : 0.0;
    if (distance[r] < 0) continue;
    const double t = distance[r];
    double measured =
        t + draw * std::hypot(lidar_.range_noise_std, lidar_.range_noise_relative * t);
    if (lidar_.range_resolution > 0)
      measured = std::round(measured / lidar_.range_resolution) * lidar_.range_resolution;
    float* at = hit + 3 * r;
    float from[3];
    origin(world, r, from);
    if (lost || measured < cfg_.min_distance || measured > cfg_.max_distance) {
      forget(world, r);
      std::copy_n(from, 3, at);
      std::fill_n(point + 3 * r, 3, 0.0f);
      intensity_->data.row<float>(world)[r] = 0;
      continue;
    }
    distance[r] = static_cast<float>(measured);
    const float scale = t > 0 ? static_cast<float>(measured / t) : 1.0f;
    for (int k = 0; k < 3; ++k) {
      at[k] = from[k] + (at[k] - from[k]) * scale;
      point[3 * r + k] *= scale;
    }
  }
}

void LidarSensor::origin(int world, int r, float out[3]) const {
  if (!origins_.empty()) {
    std::copy_n(origins_.row<float>(world).data() + 3 * r, 3, out);
    return;
  }
  const double* frame = frame_pose(world, r / num_rays_per_frame()).pos;
  for (int k = 0; k < 3; ++k) out[k] = static_cast<float>(frame[k]);
}

}  // namespace mjsense::sensors
