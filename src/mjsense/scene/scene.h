#pragma once
// A scene: what all worlds share. Entities and terrain attached into one spec, sensors registered, the model compiled.

#include <mujoco/mujoco.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/scene/entity.h"
#include "mjsense/scene/options.h"
#include "mjsense/scene/terrain.h"

namespace mjsense {

struct SceneCfg {
  std::vector<std::pair<std::string, EntityCfg>> entities;  // attached in this order, names prefixed "name/"
  std::optional<TerrainCfg> terrain;
  std::vector<std::shared_ptr<const SensorCfg>> sensors;
  double env_spacing = 2.0;             // m, grid of world origins on a plane
  std::optional<double> extent;         // overrides stat.extent
  OptionsCfg options;
  std::function<void(mjSpec*)> spec_fn;  // called last, before compilation
};

// Names of an entity's elements, local (without the prefix), in spec order.
struct Entity {
  std::string name;
  bool fixed_base = false;
  std::vector<std::string> body_names, geom_names, site_names, joint_names, actuator_names, tendon_names, camera_names;
};

class Scene {
 public:
  explicit Scene(SceneCfg cfg);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  const mjModel* model() const;
  std::string to_xml() const;  // compiles to the same model again
  const SceneCfg& cfg() const;

  // Configured sensors in order, then those discovered in the entities' XML. Not initialized: Simulation does that.
  const std::vector<std::unique_ptr<Sensor>>& sensors() const;
  Sensor* find_sensor(std::string_view key) const;  // null if there is none
  Sensor& sensor(std::string_view key) const;       // throws KeyError with the nearest names

  const std::vector<Entity>& entities() const;  // the terrain, if any, first
  const Entity& entity(std::string_view name) const;

  // World origins [B, 3]: zeros without terrain, a grid on a plane, (level, type) tiles on generated terrain.
  std::vector<double> env_origins(int num_worlds) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mjsense
