// SPDX-License-Identifier: Apache-2.0
#include "mjsense/effects/effect_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/config_checks.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/core/named.h"
#include "mjsense/scene/scene.h"

namespace mjsense::effects {
namespace {

bool contains(const std::vector<std::string>& list, const std::string& x) {
  return std::find(list.begin(), list.end(), x) != list.end();
}

ChainTick tick_of(const World& world) {
  return {world.id, world.key, world.seed, world.tick, world.episode};
}

}  // namespace

std::unique_ptr<Sensor> EffectSensorCfg::build() const {
  const std::string context = sensor_context(name);
  if (sensor.empty()) throw ValueError(fmt::format("{}: the sensor to read is missing", context));
  check_fields(*this, context);
  return std::make_unique<EffectSensor>(*this);
}

EffectSensor::EffectSensor(EffectSensorCfg cfg, Sensor* inner)
    : Sensor(cfg.name), cfg_(std::move(cfg)), inner_(inner) {}

std::vector<std::string> EffectSensor::initialization_dependencies() const {
  return cfg_.sensor.empty() ? std::vector<std::string>{} : std::vector<std::string>{cfg_.sensor};
}

void EffectSensor::initialize(const SensorInit& init) {
  if (!cfg_.sensor.empty()) {
    if (!init.scene) {
      throw ValueError(fmt::format("sensor '{}': reads '{}', so it must belong to a scene", name(),
                                   cfg_.sensor));
    }
    inner_ = &init.scene->sensor(cfg_.sensor);
  }
  if (!inner_ || inner_ == this) {
    throw ValueError(fmt::format("sensor '{}': does not name another sensor to read", name()));
  }
  const std::string context = fmt::format("sensor '{}'", name()),
                    kind = fmt::format("field of '{}'", inner_->name());
  const auto check = [&](const std::vector<std::string>& fields) {
    for (const std::string& f : fields)
      find_named(inner_->fields(), &Field::name, f, context, kind);
  };
  check(cfg_.fields);
  for (const auto& effect : cfg_.effects) {
    if (!effect) throw ValueError(fmt::format("sensor '{}': an effect is null", name()));
    check(effect->fields);
  }

  clear_fields();
  streams_.clear();
  needs_every_step_ = false;
  const double tick_s = init.model->opt.timestep;
  for (const Field& in : inner_->fields()) {
    if (!cfg_.fields.empty() && !contains(cfg_.fields, in.name)) continue;
    EffectChainCfg chain_cfg;
    chain_cfg.history_length = cfg_.history_length;
    chain_cfg.flatten_history = cfg_.flatten_history;
    for (const auto& effect : cfg_.effects) {
      if (effect->fields.empty() || contains(effect->fields, in.name)) {
        chain_cfg.effects.push_back(effect);
      }
    }
    const std::string stream = in.name.empty() ? name() : name() + "/" + in.name;
    EffectChain chain(stream, in.spec, chain_cfg, init.num_worlds, tick_s,
                      tick_s * init.decimation);
    needs_every_step_ |= chain.needs_every_step();
    Field& out = add_field(in.name, chain.spec(), init.num_worlds);
    streams_.push_back({&in, &out, std::move(chain)});
  }
}

void EffectSensor::compute(const World& world) {
  const int w = world.id;
  for (Stream& s : streams_) {
    s.chain.apply(tick_of(world), {s.in->data.row_data(w), s.in->data.row_bytes()},
                  {s.out->data.row_data(w), s.out->data.row_bytes()});
  }
}

void EffectSensor::reset(const World& world) {
  for (Stream& s : streams_) s.chain.reset(tick_of(world));
}

}  // namespace mjsense::effects
