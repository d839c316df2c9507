// SPDX-License-Identifier: Apache-2.0
#pragma once
// A scene: what all worlds share. Entities and terrain attached into one spec, sensors registered,
// the model compiled.

#include <mujoco/mujoco.h>

#include <functional>
#include <map>
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
  // A whole model to start from, as it is: names without a prefix, any number of free joints, its
  // own options unless `options` are set. Its sensors are discovered; it is no entity. Empty: an
  // empty world.
  ModelSource base;
  // Attached next, without a prefix.
  std::optional<TerrainCfg> terrain;
  // Attached in this order, names prefixed "name/".
  std::vector<std::pair<std::string, EntityCfg>> entities;
  std::vector<std::shared_ptr<const SensorCfg>> sensors;
  double env_spacing = 2.0;      // m, grid of world origins on a plane
  std::optional<double> extent;  // m, overrides stat.extent
  OptionsCfg options;
  // Called last, before compilation; sensors that it adds are not discovered.
  std::function<void(mjSpec*)> spec_fn;
  // Spec that the scene is built in (its contents are the base) and that must live as long as the
  // scene; null: one of the scene's own. The Python package passes its MjSpec's, so that spec_fn
  // sees the real thing.
  mjSpec* spec = nullptr;
};
template <class V>
void visit_fields(V& v, SceneCfg& c) {
  v.object("SceneCfg", "The configuration shared by all worlds.");
  v.python("num_envs", "int", "1",
           "Number of worlds B; ``Simulation(num_worlds=...)`` overrides it.");
  v("env_spacing", c.env_spacing, "Distance between the origins of neighbouring worlds on a plane.")
      .unit("m")
      .at_least(0);
  v("terrain", c.terrain, "The ground; None adds no ground.");
  v("entities", c.entities, "Models by name; they are attached in this order.");
  v.python("sensors", "Sequence[Any]", "()",
           "Sensor configurations, user-defined configurations with ``build()``, or "
           ":class:`mjsense.Sensor` objects.");
  v("extent", c.extent, "Value that replaces ``stat.extent`` of the model.").unit("m").positive();
  v.python("spec_fn", "Callable[[mujoco.MjSpec], None] | None", "None",
           "Function that edits the MjSpec last, before compilation.");
  v("options", c.options, "Physics options.");
  v.python(
      "base", "str | Path | None", "None",
      "A complete model (path or XML text) that the scene starts from, used unchanged: its names "
      "get no prefix, it may have any number of free joints, and its ``<option>`` is kept unless "
      "``options`` are set. Its sensors become sensors of the scene; it is not an entity.");
}

// Names of an entity's elements, local (without the prefix), in model order. An element that its
// MJCF leaves unnamed is given a name: its type and its number among the entity's elements of that
// type, "geom_3"; a free joint "floating_base_joint".
struct Entity {
  std::string name;
  bool fixed_base = false;  // no free joint
  std::vector<std::string> body_names, geom_names, site_names, joint_names, actuator_names,
      tendon_names, camera_names;
};

class Scene {
 public:
  // Throws ValueError or KeyError that names the entity or sensor at fault.
  explicit Scene(SceneCfg cfg);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // One keyframe, "init_state": the first keyframes of the entities joined. A world starts at
  // qpos0, not there.
  const mjModel* model() const;
  // With assets() as files beside it compiles to the same model again. Files on disk are named by
  // absolute path.
  std::string to_xml() const;
  const std::map<std::string, std::string>& assets() const;
  const SceneCfg& cfg() const;

  // Configured sensors in order, then those discovered in the entities' XML. Not initialized:
  // Simulation does that.
  const std::vector<std::unique_ptr<Sensor>>& sensors() const;
  Sensor* find_sensor(std::string_view key) const;  // null if there is none
  Sensor& sensor(std::string_view key) const;       // throws KeyError with the nearest names

  // The sensors hold the rows of one simulation at a time: this scene is taken until the result is
  // destroyed. Throws RuntimeError if it is taken.
  [[nodiscard]] std::shared_ptr<void> claim();

  const std::vector<Entity>& entities() const;        // the terrain, if any, first
  const Entity& entity(std::string_view name) const;  // throws KeyError with the nearest names

  // World origins [B, 3], m: zeros without terrain, a grid on a plane, spawn points of (level,
  // type) tiles on generated terrain.
  std::vector<double> env_origins(int num_worlds) const;
  const Terrain* terrain() const;  // null if there is none

  // What was found odd but not wrong: options of entities that are not carried over, further
  // keyframes, MuJoCo's own.
  const std::vector<std::string>& warnings() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mjsense
