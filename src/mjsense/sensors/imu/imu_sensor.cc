// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/imu/imu_sensor.h"

#include <fmt/format.h>

#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/config_checks.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/model_sensors/builtin_draw.h"
#include "mjsense/sensors/imu/imu_data.h"

namespace mjsense::sensors {
namespace {

mjsSensor* add_sensor(mjSpec* spec, mjtSensor type, mjtObj object, const std::string& site,
                      const std::string& name) {
  mjsSensor* s = mjs_addSensor(spec);
  mjs_setName(s->element, name.c_str());
  s->type = type;
  s->objtype = object;
  mjs_setString(s->objname, site.c_str());
  return s;
}

}  // namespace

std::unique_ptr<Sensor> ImuSensorCfg::build() const {
  const std::string context = sensor_context(name);
  check_fields(*this, context);
  if (site.name.empty() || (!site.type.empty() && site.type != "site")) {
    throw ValueError(fmt::format("sensor '{}': needs a site, not {} '{}'", name,
                                 site.type.empty() ? "object" : site.type, site.name));
  }
  return std::make_unique<ImuSensor>(*this);
}

SensorKind imu_kind() { return sensor_kind<ImuSensorCfg>(&kImuData); }

ImuSensor::ImuSensor(ImuSensorCfg cfg) : Sensor(cfg.name), cfg_(std::move(cfg)) {
  try {
    model_ = cfg_.preset.empty() ? cfg_.model : imu_preset(cfg_.preset);
  } catch (const KeyError& e) {
    throw KeyError(fmt::format("sensor '{}': {}", name(), e.what()));
  }
}

void ImuSensor::edit_spec(mjSpec* spec) {
  const std::string site = cfg_.site.full_name();
  if (!mjs_findElement(spec, mjOBJ_SITE, site.c_str())) {
    throw_unknown(fmt::format("sensor '{}'", name()), "site", site,
                  scene::spec_names(spec, mjOBJ_SITE));
  }
  add_sensor(spec, mjSENS_ACCELEROMETER, mjOBJ_SITE, site, mujoco_name("acc"));
  add_sensor(spec, mjSENS_GYRO, mjOBJ_SITE, site, mujoco_name("gyro"));
  if (cfg_.orientation) {
    add_sensor(spec, mjSENS_FRAMEQUAT, mjOBJ_SITE, site, mujoco_name("quat"));
  }
}

void ImuSensor::initialize(const SensorInit& init) {
  clear_fields();
  parts_.clear();
  needs_every_step_ = has_errors_ = false;
  const std::string frame = "site " + cfg_.site.full_name();
  const auto add = [&](const char* part, int size, const std::string& axes,
                       effects::Effects effects) {
    const int id = mj_name2id(init.model, mjOBJ_SENSOR, mujoco_name(part).c_str());
    if (id < 0) {
      throw ValueError(
          fmt::format("sensor '{}': the model has no sensor '{}'", name(), mujoco_name(part)));
    }
    if (parts_.empty()) accelerometer_ = id;
    SensorSpec spec = kImuData.spec(part, {size}, axes);
    const double tick_s = init.model->opt.timestep;
    effects::EffectChainCfg chain_cfg;
    has_errors_ |= !effects.empty();
    chain_cfg.effects = std::move(effects);
    effects::EffectChain chain(name() + "/" + part, spec, chain_cfg, init.num_worlds, tick_s,
                               tick_s * init.decimation);
    needs_every_step_ |= chain.needs_every_step();
    Field& field = add_field(part, spec, init.num_worlds);
    parts_.push_back({&field, init.model->sensor_adr[id], std::move(chain),
                      std::vector<float>(static_cast<std::size_t>(init.num_worlds) * size)});
  };
  const auto device = [&](const ImuModel::Axis& axis) {
    effects::Effects effects = imu_effects(axis);
    effects.insert(effects.end(), cfg_.effects.begin(), cfg_.effects.end());
    return effects;
  };
  add("acc", 3, frame, device(model_.accelerometer));
  add("gyro", 3, frame, device(model_.gyroscope));
  if (cfg_.orientation) add("quat", 4, "world", {});
}

void ImuSensor::compute(const World& world) {
  const effects::ChainTick tick{world.id, world.key, world.seed, world.tick, world.episode};
  for (Part& part : parts_) {
    const std::span<float> out = part.field->data.row<float>(world.id);
    float* clean = part.clean.data() + world.id * out.size();
    for (std::size_t i = 0; i < out.size(); ++i) {
      clean[i] = static_cast<float>(world.data->sensordata[part.address + i]);
    }
    part.chain.apply(tick, std::as_bytes(std::span(clean, out.size())),
                     std::as_writable_bytes(out));
  }
}

void ImuSensor::reset(const World& world) {
  const effects::ChainTick tick{world.id, world.key, world.seed, world.tick, world.episode};
  for (Part& part : parts_) part.chain.reset(tick);
}

void ImuSensor::draw(const World& world, DebugShapes& shapes) {
  scene::draw_sensor_frame(world, accelerometer_, name(), shapes);
}

}  // namespace mjsense::sensors
