// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/scene.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/named.h"
#include "mjsense/scene/attach.h"
#include "mjsense/scene/backdrop.h"
#include "mjsense/scene/compiler_settings.h"
#include "mjsense/scene/default_lighting.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/model_check.h"
#include "mjsense/scene/model_sensors/model_sensor.h"
#include "mjsense/scene/mujoco_log.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {
namespace {

void check_name(const std::string& name, bool has_terrain, const std::vector<Attached>& before) {
  if (name.empty()) throw ValueError("scene: an entity needs a name");
  if (name.find('/') != std::string::npos)
    throw ValueError(fmt::format("entity '{}': '/' is not allowed in a name", name));
  if (has_terrain && name == "terrain")
    throw ValueError("entity 'terrain': the name is reserved for the scene's terrain");
  for (const Attached& other : before) {
    if (other.name == name)
      throw ValueError(fmt::format("entity '{}': two entities have this name", name));
  }
}

Entity describe(const mjModel* model, const std::string& name, bool fixed_base) {
  const auto names = [&](mjtObj type) {
    return entity_elements(model, nullptr, name, type, "").names;
  };
  return {name,
          fixed_base,
          names(mjOBJ_BODY),
          names(mjOBJ_GEOM),
          names(mjOBJ_SITE),
          names(mjOBJ_JOINT),
          names(mjOBJ_ACTUATOR),
          names(mjOBJ_TENDON),
          names(mjOBJ_CAMERA)};
}

}  // namespace

namespace {

// Terrain, entities, options and sensors are checked where they are used.
void check_scene(const SceneCfg& cfg) {
  for (const char* field : {"env_spacing", "extent"})
    check_field(*struct_of<SceneCfg>().find(field), &cfg, "scene");
}

}  // namespace

struct Scene::Impl {
  SceneCfg cfg;
  Vfs vfs;
  SpecPtr spec;
  ModelPtr model;
  std::optional<Terrain> terrain;
  std::vector<Attached> attached;
  std::vector<Entity> entities;
  std::vector<std::unique_ptr<Sensor>> sensors;
  std::vector<std::string> warnings;
  std::weak_ptr<void> claim;

  void build();
  void attach(const EntityCfg* backdrop);
  void set_options();
  void check_base_alone();
  void add(std::unique_ptr<Sensor> sensor);
  void add_sensors();
  void compile();
};

void Scene::Impl::build() {
  std::vector<std::string> said;
  std::optional<EntityCfg> backdrop;
  if (!cfg.backdrop.empty()) backdrop = backdrop_entity(cfg.backdrop);  // it captures warnings too
  {
    WarningCapture capture(said);
    attach(backdrop ? &*backdrop : nullptr);
  }
  for (std::string& text : said) {  // it is irrelevant to users which entity's <size> was used
    if (!text.starts_with("Attach conflict")) warnings.push_back(std::move(text));
  }
  add_sensors();
  add_keyframes(spec.get(), attached.front().keys);  // the base is the first element
  if (cfg.spec_fn) cfg.spec_fn(spec.get());
  if (cfg.terrain && cfg.terrain->daylight) add_daylight(spec.get());
  compile();

  if (cfg.terrain) entities.push_back(describe(model.get(), "terrain", true));
  for (const Attached& entity : attached) {
    if (entity.name.empty()) continue;
    entities.push_back(describe(model.get(), entity.name, entity.fixed_base));
  }
}

// Uses the configured options; if none is configured, a base keeps its own.
void Scene::Impl::set_options() {
  mjOption standard, configured;
  mj_defaultOption(&standard);
  configured = standard;
  apply_options(OptionsCfg{}, standard);
  apply_options(cfg.options, configured);
  const bool has_base = spec_elements(spec.get(), mjOBJ_BODY).size() > 1 ||
                        mjs_firstElement(spec.get(), mjOBJ_GEOM) != nullptr;
  if (!has_base || !differing_options(standard, configured).empty()) spec->option = configured;
}

// Whole-model <compiler> settings of the base would apply to everything in the scene.
void Scene::Impl::check_base_alone() {
  const std::vector<std::string> settings = whole_model_settings(spec.get());
  if (settings.empty() || (!cfg.terrain && cfg.entities.empty())) return;
  throw ValueError(
      fmt::format("scene base: its <compiler> sets {}, which would also affect the attached "
                  "entities; make it an entity, or remove the setting",
                  fmt::join(settings, ", ")));
}

// Adds base, options, terrain, entities and the backdrop, if it is not null, to the spec.
void Scene::Impl::attach(const EntityCfg* backdrop) {
  check_scene(cfg);
  spec = cfg.spec           ? SpecPtr(cfg.spec, SpecDelete{false})
         : cfg.base.empty() ? SpecPtr(mj_makeSpec())
                            : parse_model(cfg.base, "scene base");
  attached.push_back(adopt_base(spec.get(), cfg.base, vfs));
  set_options();
  if (std::isnan(spec->stat.meansize)) spec->stat.meansize = 0.03;
  if (cfg.extent) spec->stat.extent = *cfg.extent;
  spec->compiler.savecompiled = 0;             // numbers are saved exactly
  spec->compiler.conflict = mjCONFLICT_MERGE;  // the larger size is used
  check_base_alone();
  if (cfg.terrain) terrain.emplace(*cfg.terrain).add_to(spec.get());
  for (const auto& [name, entity] : cfg.entities) {
    check_name(name, cfg.terrain.has_value(), attached);
    attached.push_back(attach_entity(spec.get(), name, entity, vfs, warnings));
  }
  if (!backdrop) return;
  const std::string name(kBackdrop);
  check_name(name, cfg.terrain.has_value(), attached);
  attached.push_back(attach_entity(spec.get(), name, *backdrop, vfs, warnings));
}

// Keys are unique; two sensors with the same name are always an error.
void Scene::Impl::add(std::unique_ptr<Sensor> sensor) {
  const std::string& key = sensor->name();
  if (key.empty()) throw ValueError("scene: a sensor needs a name");
  for (const auto& other : sensors) {
    if (other->name() == key) {
      throw ValueError(
          fmt::format("sensor '{}': already exists in the scene; two sensors have this name", key));
    }
  }
  for (const Attached& entity : attached) {
    if (entity.name == key) {
      warnings.push_back(fmt::format("sensor '{}' has the same name as an entity", key));
    }
  }
  sensors.push_back(std::move(sensor));
}

void Scene::Impl::add_sensors() {
  for (const auto& sensor_cfg : cfg.sensors) {
    add(sensor_cfg->build());
    sensors.back()->edit_spec(spec.get());
  }
  const std::size_t configured = sensors.size();
  // MuJoCo sensors without a configured sensor: those of the entities' XML, then those added by
  // other sensors.
  for (const std::string& name : spec_names(spec.get(), mjOBJ_SENSOR)) {
    const auto taken = [&](const auto& sensor) { return sensor->name() == name; };
    if (std::none_of(sensors.begin(), sensors.end(), taken))
      add(std::make_unique<ModelSensor>(name));
  }
  for (std::size_t i = 0; i < configured; ++i) {
    for (auto& part : sensors[i]->parts()) add(std::move(part));
  }
}

void Scene::Impl::compile() {
  try {
    WarningCapture capture(warnings);
    model = scene::compile(spec.get(), vfs);
  } catch (const RuntimeError& error) {
    throw RuntimeError(fmt::format("scene: {}", error.what()));
  }
  if (!model) throw ValueError(fmt::format("scene: {}", one_line(mjs_getError(spec.get()))));
  check_model(model.get(), warnings);
  merge_initial_states(attached, model.get());
  if (!mj_copyBack(spec.get(), model.get())) {  // copies the keyframe to the spec, for to_xml()
    throw RuntimeError(fmt::format("scene: {}", mjs_getError(spec.get())));
  }
}

Scene::Scene(SceneCfg cfg) : impl_(std::make_unique<Impl>()) {
  impl_->cfg = std::move(cfg);
  impl_->build();
}

Scene::~Scene() = default;

const mjModel* Scene::model() const { return impl_->model.get(); }
const SceneCfg& Scene::cfg() const { return impl_->cfg; }
const std::map<std::string, std::string>& Scene::assets() const { return impl_->vfs.files(); }
const std::vector<std::unique_ptr<Sensor>>& Scene::sensors() const { return impl_->sensors; }
const std::vector<Entity>& Scene::entities() const { return impl_->entities; }
const std::vector<std::string>& Scene::warnings() const { return impl_->warnings; }

void Scene::set_options(const OptionsCfg& options) {
  if (!impl_->claim.expired())
    throw RuntimeError("scene: its options cannot change once it belongs to a simulation");
  mjOption option;
  mj_defaultOption(&option);
  apply_options(options, option);
  impl_->cfg.options = options;
  impl_->spec->option = impl_->model->opt = option;
}

std::shared_ptr<void> Scene::claim() {
  if (!impl_->claim.expired()) {
    throw RuntimeError(
        "this scene belongs to a simulation already; create another Scene from the same "
        "configuration");
  }
  std::shared_ptr<void> claim = std::make_shared<char>();
  impl_->claim = claim;
  return claim;
}

std::string Scene::to_xml() const { return save_xml(impl_->spec.get()); }

Sensor* Scene::find_sensor(std::string_view key) const {
  for (const auto& sensor : impl_->sensors) {
    if (sensor->name() == key) return sensor.get();
  }
  return nullptr;
}

Sensor& Scene::sensor(std::string_view key) const {
  if (Sensor* sensor = find_sensor(key)) return *sensor;
  const auto name = [](const auto& sensor) { return sensor->name(); };
  throw KeyError(fmt::format("scene: sensor '{}' not found{}", key,
                             suggest(key, names_of(impl_->sensors, name))));
}

const Entity& Scene::entity(std::string_view name) const {
  std::vector<std::string> names;
  for (const Entity& entity : impl_->entities) {
    if (entity.name == name) return entity;
    names.push_back(entity.name);
  }
  throw KeyError(fmt::format("scene: entity '{}' not found{}", name, suggest(name, names)));
}

std::vector<double> Scene::env_origins(int num_worlds) const {
  if (num_worlds < 1)
    throw ValueError(
        fmt::format("scene: env_origins of {} worlds; expected at least 1", num_worlds));
  if (!impl_->terrain) return std::vector<double>(3 * num_worlds);
  return impl_->terrain->env_origins(num_worlds, impl_->cfg.env_spacing);
}

const Terrain* Scene::terrain() const { return impl_->terrain ? &*impl_->terrain : nullptr; }

}  // namespace mjsense::scene
