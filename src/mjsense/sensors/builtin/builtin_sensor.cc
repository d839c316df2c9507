#include "mjsense/sensors/builtin/builtin_sensor.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scene/scene.h"
#include "mjsense/scene/spec.h"
#include "mjsense/sensors/builtin/builtin_draw.h"
#include "mjsense/sensors/builtin/builtin_spec.h"
#include "mjsense/sensors/builtin/builtin_types.h"

namespace mjsense {
namespace {

constexpr std::array<std::string_view, 3> kInterp = {"zoh", "linear", "cubic"};
constexpr std::array<std::string_view, 4> kDataTypes = {"real", "positive", "axis", "quaternion"};
constexpr std::array<std::string_view, 3> kStages = {"pos", "vel", "acc"};

template <std::size_t N>
int index_of(const std::array<std::string_view, N>& words, std::string_view word,
             std::string_view field, std::string_view place) {
  const auto it = std::find(words.begin(), words.end(), word);
  if (it == words.end()) {
    throw ValueError(
        fmt::format("{}: {} '{}' is not one of {}", place, field, word, fmt::join(words, ", ")));
  }
  return static_cast<int>(it - words.begin());
}

std::string or_list(const std::vector<std::string>& words) {
  if (words.size() == 1) return words[0];
  return fmt::format("{} or {}", fmt::join(words.begin(), words.end() - 1, ", "), words.back());
}

void check_object(const ObjRef& ref, const std::vector<std::string>& allowed,
                  std::string_view field, std::string_view type, std::string_view place) {
  if (std::find(allowed.begin(), allowed.end(), ref.type) == allowed.end()) {
    throw ValueError(fmt::format("{}: {} requires {}.type {}, not '{}'", place, type, field,
                                 or_list(allowed), ref.type));
  }
  if (ref.name.empty())
    throw ValueError(fmt::format("{}: {} requires {}.name", place, type, field));
}

// Bits of the wanted fields; their order is MuJoCo's.
int range_mask(const std::vector<std::string>& data, std::string_view place) {
  std::vector<std::string> names;
  for (const RangeField& field : range_fields()) names.emplace_back(field.name);
  int mask = 0, last = -1;
  for (const std::string& name : data) {
    const int i = static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
    if (i == static_cast<int>(names.size())) {
      throw ValueError(fmt::format("{}: data has no field '{}'; fields are {}", place, name,
                                   fmt::join(names, ", ")));
    }
    if (i <= last) {
      throw ValueError(fmt::format("{}: data fields ({}) must be distinct and in the order {}",
                                   place, fmt::join(data, ", "), fmt::join(names, ", ")));
    }
    mask |= 1 << i;
    last = i;
  }
  if (mask == 0) throw ValueError(fmt::format("{}: rangefinder without data fields", place));
  return mask;
}

bool is_unit(mjtSensor type) {
  return type == mjSENS_FRAMEQUAT || type == mjSENS_BALLQUAT || type == mjSENS_FRAMEXAXIS ||
         type == mjSENS_FRAMEYAXIS || type == mjSENS_FRAMEZAXIS;
}

}  // namespace

std::unique_ptr<Sensor> make_discovered_sensor(const std::string& name) {
  return std::make_unique<BuiltinSensor>(name);
}

std::string BuiltinSensorCfg::key() const {
  return obj.entity.empty() ? name : obj.entity + "/" + name;
}

void BuiltinSensorCfg::validate() const {
  if (name.empty()) throw ValueError("sensor '': a sensor needs a name");
  const std::string place = fmt::format("sensor '{}'", key());
  const BuiltinType& type = builtin_type(sensor_type, place);

  const std::vector<std::string> objects = allowed_objects(type.group);
  const std::vector<std::string> refs = allowed_refs(type.group);
  if (!objects.empty()) {
    if (obj.empty()) {
      throw ValueError(
          fmt::format("{}: {} requires obj (type {})", place, type.name, or_list(objects)));
    }
    check_object(obj, objects, "obj", type.name, place);
  }
  const bool needs_ref = !refs.empty() && type.group != BuiltinGroup::kFrame;
  if (needs_ref && ref.empty()) {
    throw ValueError(fmt::format("{}: {} requires ref (type {})", place, type.name, or_list(refs)));
  }
  if (!ref.empty()) {
    if (refs.empty() && type.group != BuiltinGroup::kPlugin) {
      throw ValueError(fmt::format("{}: {} takes no ref", place, type.name));
    }
    if (!refs.empty()) check_object(ref, refs, "ref", type.name, place);
  }

  if (!std::isfinite(cutoff))
    throw ValueError(fmt::format("{}: cutoff = {} is not finite", place, cutoff));
  if (cutoff > 0 && is_unit(type.type)) {
    throw ValueError(fmt::format("{}: cutoff = {} cannot be applied to the unit vector of {}",
                                 place, cutoff, type.name));
  }
  if (!(noise >= 0)) throw ValueError(fmt::format("{}: noise = {} must be >= 0", place, noise));
  if (nsample < 0) throw ValueError(fmt::format("{}: nsample = {} must be >= 0", place, nsample));
  if (!(delay >= 0)) throw ValueError(fmt::format("{}: delay = {} s must be >= 0", place, delay));
  if (!(interval >= 0))
    throw ValueError(fmt::format("{}: interval = {} s must be >= 0", place, interval));
  if ((delay > 0 || interval > 0) && nsample == 0) {
    throw ValueError(fmt::format("{}: delay and interval need a history: nsample > 0", place));
  }
  if (!(phase <= 0) || (phase < 0 && phase <= -interval)) {
    throw ValueError(fmt::format("{}: phase = {} s must be in (-interval, 0] = (-{}, 0]", place,
                                 phase, interval));
  }
  index_of(kInterp, interp, "interp", place);

  if (type.group == BuiltinGroup::kRangefinder) range_mask(data, place);
  if (enclosed && type.group != BuiltinGroup::kInside) {
    throw ValueError(
        fmt::format("{}: enclosed is an option of insidesite, not of {}", place, type.name));
  }
  if (type.group == BuiltinGroup::kUser) {
    if (dim < 1)
      throw ValueError(fmt::format("{}: a user sensor requires dim >= 1, not {}", place, dim));
    index_of(kDataTypes, datatype, "datatype", place);
    index_of(kStages, needstage, "needstage", place);
  }
  if (type.group == BuiltinGroup::kPlugin && plugin.empty() == instance.empty()) {
    throw ValueError(
        fmt::format("{}: a plugin sensor requires plugin or instance, one of them", place));
  }
}

std::unique_ptr<Sensor> BuiltinSensorCfg::build() const {
  validate();
  return std::make_unique<BuiltinSensor>(*this);
}

BuiltinSensor::BuiltinSensor(const BuiltinSensorCfg& cfg)
    : Sensor(cfg.key()), cfg_(std::make_unique<BuiltinSensorCfg>(cfg)) {}

void BuiltinSensor::edit_spec(mjSpec* spec) {
  if (!cfg_) return;
  const std::string place = fmt::format("sensor '{}'", name());
  if (mjs_findElement(spec, mjOBJ_SENSOR, name().c_str())) {
    throw ValueError(cfg_->obj.entity.empty()
                         ? fmt::format("{}: already exists in the scene", place)
                         : fmt::format("{}: defined in both entity XML and scene config", place));
  }
  const BuiltinType& type = builtin_type(cfg_->sensor_type, place);
  mjsSensor* sensor = mjs_addSensor(spec);
  mjs_setName(sensor->element, name().c_str());
  sensor->type = type.type;
  const auto attach = [&](const ObjRef& ref, mjtObj& target_type, mjString* target_name) {
    if (ref.empty() || type.group == BuiltinGroup::kWorld) return;
    target_type = obj_type(ref.type, place);
    find_in_spec(spec, target_type, ref.full_name(), place);
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
  sensor->interp = index_of(kInterp, cfg_->interp, "interp", place);
  sensor->delay = cfg_->delay;
  sensor->interval[0] = cfg_->interval;
  sensor->interval[1] = cfg_->phase;
  switch (type.group) {
    case BuiltinGroup::kRangefinder:
      sensor->intprm[0] = range_mask(cfg_->data, place);
      break;
    case BuiltinGroup::kInside:
      sensor->intprm[0] = cfg_->enclosed;
      break;
    case BuiltinGroup::kUser:
      sensor->dim = cfg_->dim;
      sensor->datatype =
          static_cast<mjtDataType>(index_of(kDataTypes, cfg_->datatype, "datatype", place));
      sensor->needstage = static_cast<mjtStage>(
          mjSTAGE_POS + index_of(kStages, cfg_->needstage, "needstage", place));
      break;
    case BuiltinGroup::kPlugin:
      sensor->plugin.active = 1;
      if (!cfg_->plugin.empty()) {
        if (mjs_activatePlugin(spec, cfg_->plugin.c_str()) != 0) {
          throw ValueError(fmt::format("{}: MuJoCo has no plugin '{}'", place, cfg_->plugin));
        }
        mjsPlugin* plugin = mjs_addPlugin(spec);
        mjs_setString(plugin->plugin_name, cfg_->plugin.c_str());
        mjs_setName(plugin->element, name().c_str());
        mjs_setString(sensor->plugin.plugin_name, cfg_->plugin.c_str());
        mjs_setString(sensor->plugin.name, name().c_str());
      } else {
        find_in_spec(spec, mjOBJ_PLUGIN, cfg_->instance, place);
        mjs_setString(sensor->plugin.name, cfg_->instance.c_str());
      }
      break;
    default:
      break;
  }
}

void BuiltinSensor::initialize(const SensorInit& init) {
  const mjModel* m = init.model;
  id_ = resolve(m, mjOBJ_SENSOR, name(), fmt::format("sensor '{}'", name()));
  adr_ = m->sensor_adr[id_];
  dim_ = m->sensor_dim[id_];
  needs_ = static_cast<mjtStage>(m->sensor_needstage[id_]);
  history_adr_ = m->sensor_historyadr[id_];
  nsample_ = history_adr_ < 0 ? 0 : m->sensor_history[2 * id_];
  SensorSpec spec = describe_builtin(m, id_);
  clear_fields();
  field_ = &add_field("", spec, init.num_worlds);
  if (nsample_ > 0) {
    spec.shape = {nsample_, dim_};
    spec.description = fmt::format("samples of '{}' before its delay, newest first", name());
    history_ = &add_field("history", spec, init.num_worlds);
  }
}

void BuiltinSensor::compute(const World& world) {
  const mjtNum* values = world.data->sensordata + adr_;
  std::span<float> row = field_->data.row<float>(world.id);
  for (int i = 0; i < dim_; ++i) row[i] = static_cast<float>(values[i]);
  if (nsample_ == 0) return;

  // MuJoCo's ring: [user, index of the newest sample, nsample times, nsample x dim values].
  const mjtNum* ring = world.data->history + history_adr_;
  const int newest = static_cast<int>(ring[1]);
  const mjtNum* samples = ring + 2 + nsample_;
  std::span<float> past = history_->data.row<float>(world.id);
  for (int k = 0; k < nsample_; ++k) {
    const mjtNum* sample = samples + ((newest - k + nsample_) % nsample_) * dim_;
    for (int i = 0; i < dim_; ++i) past[k * dim_ + i] = static_cast<float>(sample[i]);
  }
}

void BuiltinSensor::draw(const World& world, DebugShapes& shapes) {
  draw_sensor_frame(world, id_, name(), shapes);
}

}  // namespace mjsense
