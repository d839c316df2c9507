// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <map>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/config_checks.h"
#include "mjsense/core/named.h"
#include "mjsense/effects/calibration.h"
#include "mjsense/effects/noise.h"
#include "mjsense/sensors/imu/imu_sensor.h"

namespace mjsense::sensors {
namespace {

constexpr double kDeg = std::numbers::pi / 180.0;  // rad
constexpr double kG = 9.80665;                     // m/s^2

ImuModel mpu6050() {
  ImuModel m;
  m.gyroscope = {0.005 * kDeg, {20 * kDeg, 20 * kDeg, 20 * kDeg}, 0.03, 0.02, 2000 * kDeg,
                 kDeg / 16.4};
  m.accelerometer = {400e-6 * kG, {0.050 * kG, 0.050 * kG, 0.080 * kG}, 0.03, 0.02, 16 * kG,
                     kG / 2048};
  return m;
}

ImuModel icm42688p() {
  ImuModel m;
  m.gyroscope.noise_density = 2.8e-3 * kDeg;
  m.gyroscope.range = 2000 * kDeg;
  m.gyroscope.resolution = 2000 * kDeg / 32768;
  m.accelerometer.noise_density = 70e-6 * kG;
  m.accelerometer.range = 16 * kG;
  m.accelerometer.resolution = 16 * kG / 32768;
  return m;
}

}  // namespace

ImuModel imu_preset(const std::string& name) {
  static const std::map<std::string, ImuModel> kPresets = {
      {"ideal", {}}, {"mpu6050", mpu6050()}, {"icm42688p", icm42688p()}};
  using Preset = std::pair<const std::string, ImuModel>;
  return find_named(kPresets, &Preset::first, name, "imu", "preset").second;
}

void validate(const ImuModel::Axis& a, std::string_view context) {
  require(a.bias_drift == 0 || a.bias_drift_time_s > 0, context, "bias_drift_time_s",
          a.bias_drift_time_s, "positive where there is a bias_drift");
}

effects::Effects imu_effects(const ImuModel::Axis& axis) {
  effects::Effects effects;
  if (axis.scale_tolerance > 0 || axis.cross_axis_tolerance > 0) {
    effects::Misalignment m;
    m.scale_error_std = axis.scale_tolerance / 3;
    m.angle_std = axis.cross_axis_tolerance / 3;
    effects.push_back(std::make_shared<effects::Misalignment>(m));
  }
  const std::array<double, 3>& tolerance = axis.bias_tolerance;
  if (std::ranges::any_of(tolerance, [](double b) { return b > 0; })) {
    effects.push_back(std::make_shared<effects::EpisodeBias>(
        effects::Draw::gaussian({tolerance[0] / 3, tolerance[1] / 3, tolerance[2] / 3})));
  }
  if (axis.bias_drift > 0) {
    effects::BiasDrift drift;
    drift.std = {axis.bias_drift};
    drift.time_constant_s = axis.bias_drift_time_s;
    effects.push_back(std::make_shared<effects::BiasDrift>(drift));
  }
  if (axis.noise_density > 0) {
    effects.push_back(
        std::make_shared<effects::Noise>(effects::Noise::with_density({axis.noise_density})));
  }
  if (axis.range > 0)
    effects.push_back(std::make_shared<effects::Clip>(effects::Clip::saturation(axis.range)));
  if (axis.resolution > 0) {
    effects.push_back(std::make_shared<effects::Quantize>(effects::PerComponent{axis.resolution}));
  }
  return effects;
}

}  // namespace mjsense::sensors
