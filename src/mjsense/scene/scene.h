// SPDX-License-Identifier: Apache-2.0
#pragma once
// A scene is what all worlds share: entities and terrain attached to one spec, the registered
// sensors, and the compiled model.

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
#include "mjsense/scene/physics_options.h"
#include "mjsense/scene/terrain.h"

namespace mjsense::scene {

struct SceneCfg {
  // A complete model to start from, used unchanged: names have no prefix, it may have any number of
  // free joints, and its options are kept unless `options` are set. Its sensors are discovered; it
  // is not an entity. If empty, the scene starts from an empty world.
  ModelSource base;
  // Attached after the base, without a prefix.
  std::optional<TerrainCfg> terrain;
  // Attached in this order, with the prefix "<name>/".
  std::vector<std::pair<std::string, EntityCfg>> entities;
  // Path of a model that is only seen (backdrop.h); "": none.
  std::string backdrop;
  std::vector<std::shared_ptr<const SensorCfg>> sensors;
  double env_spacing = 2.0;      // m, grid spacing of the world origins on a plane
  std::optional<double> extent;  // m, overrides stat.extent
  OptionsCfg options;
  // Called last, before compilation. Sensors that it adds are not discovered.
  std::function<void(mjSpec*)> spec_fn;
  // Spec that the scene is built in; its contents are the base, and it must outlive the scene. If
  // null, the scene creates its own. The Python package passes the spec of a MjSpec object, so that
  // spec_fn edits the actual spec.
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
  v("backdrop", c.backdrop,
    "Surroundings that are only seen, an MJCF, .glb, .gltf or .obj file: cameras and rays show its "
    "geoms, and nothing touches them. Its names get the prefix ``backdrop/``.")
      .or_none();
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

// Local names (without the prefix) of an entity's elements, in model order. An element without a
// name in its MJCF is named by its type and its index among the entity's elements of that type,
// "geom_3"; a free joint is named "floating_base_joint".
struct Entity {
  std::string name;
  bool fixed_base = false;  // no free joint
  std::vector<std::string> body_names, geom_names, site_names, joint_names, actuator_names,
      tendon_names, camera_names;
};

class Scene {
 public:
  // Throws ValueError or KeyError that names the entity or sensor with the fault.
  explicit Scene(SceneCfg cfg);
  ~Scene();
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  // Has one keyframe, "init_state", which joins the first keyframes of the entities. Worlds start
  // at qpos0, not at this keyframe.
  const mjModel* model() const;
  // With assets() as files in the same folder, compiles to the same model again. Files on disk are
  // referenced by absolute path.
  std::string to_xml() const;
  const std::map<std::string, std::string>& assets() const;
  const SceneCfg& cfg() const;
  // Replaces the physics options of the compiled model; no simulation may exist yet. Compilation
  // itself reads none of them. Throws ValueError for a wrong option.
  void set_options(const OptionsCfg& options);

  // Configured sensors in order, then those discovered in the entities' XML. Simulation initializes
  // them.
  const std::vector<std::unique_ptr<Sensor>>& sensors() const;
  Sensor* find_sensor(std::string_view key) const;  // null if there is none
  Sensor& sensor(std::string_view key) const;       // throws KeyError with the nearest names

  // Reserves the scene until the result is destroyed, because its sensors hold the rows of one
  // simulation at a time. Throws RuntimeError if it is already reserved.
  [[nodiscard]] std::shared_ptr<void> claim();

  const std::vector<Entity>& entities() const;        // the terrain, if any, first
  const Entity& entity(std::string_view name) const;  // throws KeyError with the nearest names

  // World origins [B, 3], m: zero without terrain, a grid on a plane, spawn points of (level, type)
  // tiles on generated terrain.
  std::vector<double> env_origins(int num_worlds) const;
  const Terrain* terrain() const;  // null if there is none

  // Conditions that are unusual but not errors: options of entities that are ignored, further
  // keyframes, and MuJoCo's own warnings.
  const std::vector<std::string>& warnings() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace mjsense::scene
