// SPDX-License-Identifier: Apache-2.0
#include "mjsense/episode/task.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "mjsense/core/error.h"
#include "mjsense/episode/policy.h"

namespace mjsense {

Task::Task(TaskCfg cfg) : cfg_(std::move(cfg)) {
  if (cfg_.sim_dt_ms <= 0 || cfg_.policy_dt_ms <= 0 || cfg_.policy_dt_ms % cfg_.sim_dt_ms != 0) {
    throw ValueError(
        fmt::format("task: policy_dt_ms = {} must be a positive multiple of sim_dt_ms = {}",
                    cfg_.policy_dt_ms, cfg_.sim_dt_ms));
  }
  if (cfg_.horizon <= 0)
    throw ValueError(fmt::format("task: horizon = {} must be positive", cfg_.horizon));
}

void Task::initialize(const mjModel* model, int num_worlds) {
  if (num_worlds <= 0)
    throw ValueError(fmt::format("task: {} worlds, at least 1 is needed", num_worlds));
  model_ = model;
  num_worlds_ = num_worlds;
  robot_ = std::make_unique<Robot>(cfg_.robot, model, num_worlds);
  episodes_.assign(num_worlds, {});
  initialize_task();
}

void Task::register_policy(Policy& policy) {
  if (policy_) throw ValueError("Policy already registered");
  if (!model_) throw ValueError("register_policy: initialize the task first");
  policy.initialize(*this);
  policy_ = &policy;
}

void Task::sample(int world, std::int64_t episode, const StateRow& state) {
  episodes_[world] = {.number = episode};
  Rng rng(cfg_.seed, 0, stream_of("task/sample"), static_cast<std::uint64_t>(episode));
  const Pose base = sample_scene(world, rng, state);
  robot_->write_start(state, base, rng);
}

void Task::begin(const World& world) {
  Episode& episode = episodes_[world.id];
  episode.step = 0;
  episode.done = false;
  robot_->reset(world);
}

void Task::apply(const World& world, const Action& action, const StateRow& state) {
  Episode& episode = episodes_[world.id];
  robot_->command(world, action);
  // The world's index is no part of the key: an episode is the same wherever it runs.
  Rng noise(cfg_.seed, static_cast<std::uint32_t>(episode.step), stream_of("task/action_noise"),
            static_cast<std::uint64_t>(episode.number));
  robot_->write_ctrl(world, state, cfg_.action_noise ? &noise : nullptr);
  episode.action = action;
  episode.done = episode.done || action.done;
  ++episode.step;
}

Evaluation Task::judge(int world, double reward, bool success) const {
  const Episode& episode = episodes_[world];
  return {.reward = reward,
          .success = success,
          .terminal = episode.done || (success && cfg_.terminate_upon_success),
          .truncated = episode.step >= cfg_.horizon};
}

std::string Task::obs_scene(int world) const {
  nlohmann::ordered_json scene;
  scene["task_type"] = type();
  scene["task_description"] = description(world);
  scene["policy_dt_ms"] = cfg_.policy_dt_ms;
  auto& expressions = scene["referral_expressions"] = nlohmann::ordered_json::object();
  for (const auto& [role, referrals] : referrals(world)) {
    auto& list = expressions[role] = nlohmann::ordered_json::array();
    for (const Referral& referral : referrals)
      list.push_back({referral.text, referral.probability});
  }
  if (policy_ && !policy_->phases().empty()) {
    auto& phases = scene["policy_phases"] = nlohmann::ordered_json::object();
    for (const Phase& phase : policy_->phases()) phases[std::string(phase.name)] = phase.number;
  }
  for (const auto& [key, value] : scene_info(world)) scene[key] = value;
  return scene.dump();
}

}  // namespace mjsense
