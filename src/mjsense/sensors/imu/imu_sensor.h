// SPDX-License-Identifier: Apache-2.0
#pragma once
// An inertial measurement unit at a site: accelerometer and gyroscope of one device, with its
// errors.

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/effects/all_effects.h"
#include "mjsense/effects/chain.h"
#include "mjsense/scene/entity.h"

namespace mjsense::sensors {

// Values of a device's data sheet, in SI units. Tolerances are three standard deviations over
// devices; a device is drawn for each episode. Values that a sheet does not give are 0.
struct ImuModel {
  struct Axis {
    double noise_density = 0.0;
    std::array<double, 3> bias_tolerance{};
    double scale_tolerance = 0.0;
    double cross_axis_tolerance = 0.0;
    double range = 0.0;
    double resolution = 0.0;
    double bias_drift = 0.0;
    double bias_drift_time_s = 0.0;
  };
  Axis accelerometer, gyroscope;
};
template <class V>
void visit_fields(V& v, ImuModel::Axis& c) {
  v.object("ImuAxis",
           "Error model of the accelerometer or of the gyroscope, in m/s^2 or rad/s. Tolerances "
           "are three standard deviations, drawn anew for each episode.")
      .frozen();
  v("noise_density", c.noise_density, "Density of the white noise.")
      .unit("unit/sqrt(Hz)")
      .at_least(0);
  v("bias_tolerance", c.bias_tolerance, "Turn-on bias of x, y, z.").unit("unit").at_least(0);
  v("scale_tolerance", c.scale_tolerance, "Scale error.").at_least(0);
  v("cross_axis_tolerance", c.cross_axis_tolerance, "Cross-axis sensitivity.").at_least(0);
  v("range", c.range, "Values are clipped to +-range; 0: no limit.").unit("unit").at_least(0);
  v("resolution", c.resolution, "Size of one count; 0: continuous.").unit("unit").at_least(0);
  v("bias_drift", c.bias_drift, "Standard deviation of a Gauss-Markov bias.")
      .unit("unit")
      .at_least(0);
  v("bias_drift_time_s", c.bias_drift_time_s, "Correlation time of the bias drift.").at_least(0);
}
template <class V>
void visit_fields(V& v, ImuModel& c) {
  v.object("ImuModel",
           "Error model of a device, from its data sheet; values that the data sheet omits are 0.")
      .frozen();
  v("accelerometer", c.accelerometer, "Error model of the accelerometer, in m/s^2.");
  v("gyroscope", c.gyroscope, "Error model of the gyroscope, in rad/s.");
}

// Presets:
//   ideal       no errors
//   mpu6050     InvenSense PS-MPU-6000A-00 rev. 3.4, tables 6.1 and 6.2, at +-2000 deg/s and
//               +-16 g: gyroscope 0.005 deg/s/sqrt(Hz), zero rate +-20 deg/s, scale +-3 %,
//               cross-axis +-2 %, 16.4 LSB/(deg/s); accelerometer 400 ug/sqrt(Hz), zero g +-50 mg
//               (x, y), +-80 mg (z), scale +-3 %, cross-axis +-2 %, 2048 LSB/g
//   icm42688p   TDK DS-000347 rev. 1.7, page 1, at +-2000 deg/s and +-16 g, 16 bit: gyroscope
//               2.8 mdeg/s/sqrt(Hz), accelerometer 70 ug/sqrt(Hz); offsets are not in the preset
// Throws KeyError with the available names.
ImuModel imu_preset(const std::string& name);

// Checks fields that depend on each other. Throws ValueError.
void validate(const ImuModel::Axis& axis, std::string_view context);

// The effects of the accelerometer or of the gyroscope, in the order of the signal path: scale and
// axes, bias, noise, range, resolution.
effects::Effects imu_effects(const ImuModel::Axis& axis);

inline constexpr std::array<std::string_view, 4> kImuPresets{"ideal", "mpu6050", "icm42688p", ""};

struct ImuSensorCfg : SensorCfg {
  scene::ObjRef site;
  std::string preset = "ideal";
  ImuModel model;
  bool orientation = false;
  effects::Effects effects;

  std::unique_ptr<Sensor> build() const override;
};
template <class V>
void visit_fields(V& v, ImuSensorCfg& c) {
  v.object("ImuSensorCfg",
           "Accelerometer and gyroscope at a site, with the errors of a device. ``data`` is an "
           ":class:`mjsense.sensors.ImuData`.\n\nThe clean values are the built-in sensors "
           "``<name>_acc`` and ``<name>_gyro``.",
           "imu");
  v.extends(static_cast<SensorCfg&>(c));
  v("site", c.site, "The site on which the IMU is mounted.").or_none();
  v("preset", c.preset,
    "ideal, mpu6050 (InvenSense PS-MPU-6000A-00 rev. 3.4) or icm42688p (TDK DS-000347 rev. 1.7); "
    "\"\": use model.")
      .one_of(kImuPresets);
  v("model", c.model, "Error model, used if preset is \"\".");
  v("orientation", c.orientation, "Report the orientation of the site too, without errors.");
  v("effects", c.effects,
    "Effects applied to acc and gyro after the error model: delay, rate, dropout.");
}

// Fields, in the axes of the site:
//   acc   [B, 3]  m/s^2, specific force R^T (a - g): +9.81 along up at rest, 0 in free fall
//   gyro  [B, 3]  rad/s, R^T omega
//   quat  [B, 4]  wxyz, of the site in the world
// The clean values are MuJoCo's sensors "<name>_acc", "<name>_gyro" (and "<name>_quat"), which the
// scene also registers.
class ImuSensor : public Sensor {
 public:
  explicit ImuSensor(ImuSensorCfg cfg);

  std::string_view kind() const override { return "imu"; }
  void edit_spec(mjSpec* spec) override;
  void initialize(const SensorInit& init) override;
  void compute(const World& world) override;
  void reset(const World& world) override;
  void draw(const World& world, DebugShapes& shapes) override;  // draws the axes of the site
  bool needs_every_step() const override { return needs_every_step_; }
  bool has_errors() const { return has_errors_; }

 private:
  struct Part {
    Field* field;
    int address;  // in mjData.sensordata
    effects::EffectChain chain;
    std::vector<float> clean;  // [B, size]
  };
  std::string mujoco_name(std::string_view part) const { return name() + "_" + std::string(part); }

  ImuSensorCfg cfg_;
  ImuModel model_;
  std::vector<Part> parts_;
  int accelerometer_ = -1;  // id of MuJoCo's sensor
  bool needs_every_step_ = false;
  bool has_errors_ = false;
};

}  // namespace mjsense::sensors
