// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/scene_task.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks::scenes {

SceneTask::SceneTask(episode::TaskCfg cfg, std::string_view own_scene)
    : episode::Task(std::move(cfg)), scene_(task_scene(this->cfg(), own_scene)) {}

void SceneTask::bind(const std::shared_ptr<sim::Simulation>& simulation) {
  simulation_ = simulation;
  scene_.bind(*simulation);
}

void SceneTask::initialize_task() {
  scene_.initialize(model(), num_worlds(), robot().prefix());
  // A robot on wheels stands on the ground, not at the height of the scene's pedestal for arms.
  const std::optional<double> ground = ground_height(model());
  if (ground && driving_base(robot()) >= 0) scene_.put_robot_at(*ground);
}

void SceneTask::vary_scene(int world) {
  const std::shared_ptr<sim::Simulation> simulation = simulation_.lock();
  if (scene_.vary(world, cfg().seed, static_cast<std::uint64_t>(episode(world))) && simulation)
    simulation->worlds().model_changed();
}

std::string SceneTask::light(int world) const {
  return scene_.mood(cfg().seed, static_cast<std::uint64_t>(episode(world)));
}

mjModel SceneTask::world_model(int world) const {
  const std::shared_ptr<sim::Simulation> simulation = simulation_.lock();
  return simulation ? simulation->worlds().model_of(world) : *model();
}

std::vector<int> SceneTask::adopt_scene(int world, const robots::StateRow& state) {
  return scene_.adopt(world, cfg().seed, static_cast<std::uint64_t>(episode(world)), state);
}

int SceneTask::body_of(const episode::GivenStart& start, std::string_view role) const {
  const auto found = start.objects.find(std::string(role));
  if (found == start.objects.end())
    throw ValueError(
        fmt::format("{}: the given start has no object with the role '{}'", context(), role));
  return episode::find_name(model(), mjOBJ_BODY, found->second);
}

std::vector<int> SceneTask::adopt_scene(int world, const episode::GivenStart& start,
                                        std::span<const std::string_view> roles,
                                        const robots::StateRow& state) {
  scene_.adopt(world, cfg().seed, static_cast<std::uint64_t>(episode(world)), start, state);
  std::vector<int> indices;
  for (std::string_view role : roles) {
    const auto objects = scene_.objects();
    const auto found = std::ranges::find(objects, body_of(start, role), &SceneObject::body);
    if (found == objects.end())
      throw ValueError(fmt::format("{}: '{}' is not an object that can be the {}", context(),
                                   start.objects.at(std::string(role)), role));
    indices.push_back(static_cast<int>(found - objects.begin()));
  }
  return indices;
}

std::string SceneTask::context() const {
  return fmt::format("task '{}': scene '{}'", name(), scene_.cfg().name);
}

}  // namespace mjsense::tasks::scenes
