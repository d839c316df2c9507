// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/builtin/builtin_sensor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/model_sensors/builtin_types.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scene/scene.h"

namespace mjsense::sensors {
namespace {

std::string or_list(const std::vector<std::string>& words) {
  if (words.size() == 1) return words[0];
  return fmt::format("{} or {}", fmt::join(words.begin(), words.end() - 1, ", "), words.back());
}

void check_object(const scene::ObjRef& ref, const std::vector<std::string>& allowed,
                  std::string_view field, std::string_view type, std::string_view context) {
  if (std::find(allowed.begin(), allowed.end(), ref.type) == allowed.end()) {
    throw ValueError(fmt::format("{}: {} requires {}.type {}, not '{}'", context, type, field,
                                 or_list(allowed), ref.type));
  }
  if (ref.name.empty())
    throw ValueError(fmt::format("{}: {} requires {}.name", context, type, field));
}

// Bit mask of the requested fields, which must be in MuJoCo's order.
int range_mask(const std::vector<std::string>& data, std::string_view context) {
  std::vector<std::string> names;
  for (const scene::RangeField& field : scene::range_fields()) names.emplace_back(field.name);
  int mask = 0, last = -1;
  for (const std::string& name : data) {
    const int i = static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
    if (i == static_cast<int>(names.size())) {
      throw ValueError(fmt::format("{}: data has no field '{}'; fields are {}", context, name,
                                   fmt::join(names, ", ")));
    }
    if (i <= last) {
      throw ValueError(fmt::format("{}: data fields ({}) must be distinct and in the order {}",
                                   context, fmt::join(data, ", "), fmt::join(names, ", ")));
    }
    mask |= 1 << i;
    last = i;
  }
  if (mask == 0) throw ValueError(fmt::format("{}: rangefinder without data fields", context));
  return mask;
}

bool is_unit(mjtSensor type) {
  return type == mjSENS_FRAMEQUAT || type == mjSENS_BALLQUAT || type == mjSENS_FRAMEXAXIS ||
         type == mjSENS_FRAMEYAXIS || type == mjSENS_FRAMEZAXIS;
}

}  // namespace

std::string BuiltinSensorCfg::key() const {
  return obj.entity.empty() ? name : obj.entity + "/" + name;
}

void BuiltinSensorCfg::validate() const {
  if (name.empty()) throw ValueError("sensor '': a sensor needs a name");
  const std::string context = fmt::format("sensor '{}'", key());
  check_fields(*this, context);
  const scene::BuiltinType& type = scene::builtin_type(sensor_type, context);

  const std::vector<std::string> objects = scene::allowed_objects(type.group);
  const std::vector<std::string> refs = scene::allowed_refs(type.group);
  if (!objects.empty()) {
    if (obj.empty()) {
      throw ValueError(
          fmt::format("{}: {} requires obj (type {})", context, type.name, or_list(objects)));
    }
    check_object(obj, objects, "obj", type.name, context);
  }
  const bool needs_ref = !refs.empty() && type.group != scene::BuiltinGroup::kFrame;
  if (needs_ref && ref.empty()) {
    throw ValueError(
        fmt::format("{}: {} requires ref (type {})", context, type.name, or_list(refs)));
  }
  if (!ref.empty()) {
    if (refs.empty() && type.group != scene::BuiltinGroup::kPlugin) {
      throw ValueError(fmt::format("{}: {} takes no ref", context, type.name));
    }
    if (!refs.empty()) check_object(ref, refs, "ref", type.name, context);
  }

  if (cutoff > 0 && is_unit(type.type)) {
    throw ValueError(fmt::format("{}: cutoff = {} cannot be applied to the unit vector of {}",
                                 context, cutoff, type.name));
  }
  if ((delay > 0 || interval > 0) && nsample == 0) {
    throw ValueError(fmt::format("{}: delay and interval need a history: nsample > 0", context));
  }
  if (phase < 0 && phase <= -interval) {
    throw ValueError(fmt::format("{}: phase = {} s must be in (-interval, 0] = (-{}, 0]", context,
                                 phase, interval));
  }
  if (type.group == scene::BuiltinGroup::kRangefinder) range_mask(data, context);
  if (enclosed && type.group != scene::BuiltinGroup::kInside) {
    throw ValueError(
        fmt::format("{}: enclosed applies to insidesite only, not to {}", context, type.name));
  }
  if (type.group == scene::BuiltinGroup::kUser) {
    if (dim < 1)
      throw ValueError(fmt::format("{}: a user sensor requires dim >= 1, not {}", context, dim));
  }
  if (type.group == scene::BuiltinGroup::kPlugin && plugin.empty() == instance.empty()) {
    throw ValueError(
        fmt::format("{}: a plugin sensor requires plugin or instance, one of them", context));
  }
}

std::unique_ptr<Sensor> BuiltinSensorCfg::build() const {
  validate();
  return std::make_unique<BuiltinSensor>(*this);
}

BuiltinSensor::BuiltinSensor(const BuiltinSensorCfg& cfg)
    : scene::ModelSensor(cfg.key()), cfg_(std::make_unique<BuiltinSensorCfg>(cfg)) {}

void BuiltinSensor::edit_spec(mjSpec* spec) {
  const std::string context = fmt::format("sensor '{}'", name());
  if (mjs_findElement(spec, mjOBJ_SENSOR, name().c_str())) {
    throw ValueError(cfg_->obj.entity.empty()
                         ? fmt::format("{}: already exists in the scene", context)
                         : fmt::format("{}: defined in both entity XML and scene config", context));
  }
  const scene::BuiltinType& type = scene::builtin_type(cfg_->sensor_type, context);
  mjsSensor* sensor = mjs_addSensor(spec);
  mjs_setName(sensor->element, name().c_str());
  sensor->type = type.type;
  const auto attach = [&](const scene::ObjRef& ref, mjtObj& target_type, mjString* target_name) {
    if (ref.empty() || type.group == scene::BuiltinGroup::kWorld) return;
    target_type = scene::obj_type(ref.type, context);
    scene::find_in_spec(spec, target_type, ref.full_name(), context);
    mjs_setString(target_name, ref.full_name().c_str());
  };
  attach(cfg_->obj, sensor->objtype, sensor->objname);
  attach(cfg_->ref, sensor->reftype, sensor->refname);
  if (type.type == mjSENS_FRAMELINACC || type.type == mjSENS_FRAMEANGACC) {
    sensor->reftype = mjOBJ_UNKNOWN;  // accepted and ignored, as MuJoCo's own computation does
    mjs_setString(sensor->refname, "");
  }
  sensor->cutoff = std::max(0.0, cfg_->cutoff);
  sensor->noise = cfg_->noise;
  sensor->nsample = cfg_->nsample;
  sensor->interp = static_cast<int>(static_cast<BuiltinInterp>(cfg_->interp));
  sensor->delay = cfg_->delay;
  sensor->interval[0] = cfg_->interval;
  sensor->interval[1] = cfg_->phase;
  switch (type.group) {
    case scene::BuiltinGroup::kRangefinder:
      sensor->intprm[0] = range_mask(cfg_->data, context);
      break;
    case scene::BuiltinGroup::kInside:
      sensor->intprm[0] = cfg_->enclosed;
      break;
    case scene::BuiltinGroup::kUser:
      sensor->dim = cfg_->dim;
      sensor->datatype = cfg_->datatype;
      sensor->needstage = static_cast<mjtStage>(
          mjSTAGE_POS + static_cast<int>(static_cast<BuiltinStage>(cfg_->needstage)));
      break;
    case scene::BuiltinGroup::kPlugin:
      sensor->plugin.active = 1;
      if (!cfg_->plugin.empty()) {
        if (mjs_activatePlugin(spec, cfg_->plugin.c_str()) != 0) {
          throw ValueError(fmt::format("{}: MuJoCo has no plugin '{}'", context, cfg_->plugin));
        }
        mjsPlugin* plugin = mjs_addPlugin(spec);
        mjs_setString(plugin->plugin_name, cfg_->plugin.c_str());
        mjs_setName(plugin->element, name().c_str());
        mjs_setString(sensor->plugin.plugin_name, cfg_->plugin.c_str());
        mjs_setString(sensor->plugin.name, name().c_str());
      } else {
        scene::find_in_spec(spec, mjOBJ_PLUGIN, cfg_->instance, context);
        mjs_setString(sensor->plugin.name, cfg_->instance.c_str());
      }
      break;
    default:
      break;
  }
}

SensorKind builtin_kind() { return sensor_kind<BuiltinSensorCfg>(); }

}  // namespace mjsense::sensors
