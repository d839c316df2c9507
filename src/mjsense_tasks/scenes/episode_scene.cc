// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/episode_scene.h"

#include <fmt/format.h>

#include <array>
#include <utility>

#include "mjsense/core/fields/fields.h"
#include "mjsense_tasks/scenes/absent_objects.h"
#include "mjsense_tasks/scenes/entity_model.h"
#include "mjsense_tasks/scenes/final_spec_edits.h"
#include "mjsense_tasks/scenes/generators/generator.h"

namespace mjsense::tasks::scenes {

EpisodeScene::EpisodeScene(SceneFileCfg cfg) : cfg_(std::move(cfg)) {
  check_fields(cfg_, "");
  if (!cfg_.generator.empty()) generated_ = generate(cfg_);
  for (const SceneEntityCfg& entity : cfg_.entities)
    edited_.push_back(edited_model(entity, context()));
  make_meshes();
}

std::string EpisodeScene::context() const { return fmt::format("scene '{}'", cfg_.name); }

scene::SceneCfg EpisodeScene::scene_cfg(const std::string& robot) const {
  scene::SceneCfg scene;
  if (cfg_.models) scene = cfg_.models();
  if (!cfg_.base.empty()) scene.base.path = cfg_.base;
  if (!generated_.empty()) {
    scene::EntityCfg room;
    room.model = generated_;
    room.mocap_base = false;
    scene.entities.emplace_back("room", room);
    scene.entities.emplace_back(robot, scene::EntityCfg{});
  }
  for (std::size_t i = 0; i < cfg_.entities.size(); ++i) {
    const SceneEntityCfg& one = cfg_.entities[i];
    scene::EntityCfg entity;
    if (edited_[i]) {
      entity.model.spec = edited_[i].get();
    } else {
      entity.model.path = model_path(one.model, context());
    }
    entity.pos = one.pos;
    entity.quat = one.quat;
    // Many objects at the same position would cause thousands of contacts before the first episode.
    if (is_placed(one)) {
      const Vec3 p = away(static_cast<int>(i)).p;
      entity.pos = {p.x, p.y, p.z};
    }
    scene.entities.emplace_back(one.name, entity);
    if (scene.entities.size() == 1) scene.entities.emplace_back(robot, scene::EntityCfg{});
  }
  if (scene.entities.empty()) scene.entities.emplace_back(robot, scene::EntityCfg{});
  if (cfg_.extent) scene.extent = cfg_.extent;
  if (!cfg_.models) scene.options = cfg_.options;
  scene.spec_fn = [cfg = cfg_, first = scene.spec_fn, meshes = meshes_, robot](mjSpec* spec) {
    finish_spec(spec, cfg, robot);
    if (meshes) meshes->add(spec);
    if (first) first(spec);
  };
  return scene;
}

void EpisodeScene::initialize(const mjModel* model, int num_worlds, std::string_view robot_prefix) {
  model_ = model;
  find_objects(robot_prefix);
  find_regions();
  find_furniture();
  present_.assign(num_worlds * objects_.size(), 1);
  steps_.assign(num_worlds * objects_.size(), -1);
  support_.assign(num_worlds, regions_.empty() ? 0.0 : regions_[0].height);
  make_sizes();
}

void EpisodeScene::bind(sim::Simulation& simulation) {
  simulation_ = &simulation;
  if (!cfg_.vary.empty() || !cfg_.moods.empty())
    variation_ = std::make_unique<SceneVariation>(cfg_, simulation, context());
  make_sizes();
}

bool EpisodeScene::is_placed(const SceneEntityCfg& entity) const {
  return entity.free && !cfg_.regions.empty() && entity.pos == std::array<double, 3>{};
}

}  // namespace mjsense::tasks::scenes
