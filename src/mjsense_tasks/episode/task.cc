// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/task.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/observe/env_states.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/episode/policy.h"

namespace mjsense::tasks::episode {

Task::Task(TaskCfg cfg) : cfg_(std::move(cfg)) {
  if (cfg_.ctrl_dt_ms == 0) cfg_.ctrl_dt_ms = cfg_.sim_dt_ms;
  const auto check = [](const char* name, int period, const char* of, int part) {
    if (part > 0 && period > 0 && period % part == 0) return;
    throw ValueError(fmt::format("task: {} = {} must be a positive multiple of {} = {}", name,
                                 period, of, part));
  };
  check("policy_dt_ms", cfg_.policy_dt_ms, "sim_dt_ms", cfg_.sim_dt_ms);
  check("ctrl_dt_ms", cfg_.ctrl_dt_ms, "sim_dt_ms", cfg_.sim_dt_ms);
  check("policy_dt_ms", cfg_.policy_dt_ms, "ctrl_dt_ms", cfg_.ctrl_dt_ms);
  if (cfg_.horizon <= 0)
    throw ValueError(fmt::format("task: horizon = {} must be positive", cfg_.horizon));
}

scene::SceneCfg Task::scene_cfg_with_robot() const {
  scene::SceneCfg scene = scene_cfg();
  scene.options.timestep = 0.001 * cfg_.sim_dt_ms;
  const std::string name(robots::Robot::kPrefix.substr(0, robots::Robot::kPrefix.size() - 1));
  const auto context =
      std::ranges::find(scene.entities, name, [](const auto& e) { return e.first; });
  const bool reserved = context != scene.entities.end() && context->second.model.empty();
  if (cfg_.robot.name.empty()) {
    if (reserved) {
      throw ValueError(fmt::format("task '{}' needs a robot, and none is given", this->name()));
    }
    return scene;
  }
  if (context != scene.entities.end() && !reserved) {
    throw ValueError(fmt::format(
        "task '{}' already has a robot in its scene (entity '{}'): robot '{}' cannot be added",
        this->name(), name, cfg_.robot.name));
  }
  scene::EntityCfg robot;
  robot.model = cfg_.robot.model;
  if (reserved) {
    context->second = robot;
  } else {
    scene.entities.emplace_back(name, robot);
  }
  scene.sensors.insert(scene.sensors.end(), cfg_.robot.sensors.begin(), cfg_.robot.sensors.end());
  if (cfg_.robot.edit_spec) {
    scene.spec_fn = [first = scene.spec_fn, edit = cfg_.robot.edit_spec](mjSpec* spec) {
      if (first) first(spec);
      edit(spec, std::string(robots::Robot::kPrefix));
    };
  }
  return scene;
}

void Task::initialize(const mjModel* model, int num_worlds) {
  if (num_worlds <= 0)
    throw ValueError(fmt::format("task: {} worlds; at least 1 is required", num_worlds));
  model_ = model;
  num_worlds_ = num_worlds;
  const robots::ControlPeriods periods{0.001 * cfg_.policy_dt_ms, 0.001 * cfg_.ctrl_dt_ms};
  if (whole_) {
    cfg_.robot = whole_->cfg().robot;
  } else if (cfg_.robot.name.empty()) {
    const std::string entity = robot_entity();
    cfg_.robot =
        robots::scene_robot(model, entity, robot_groups(), fmt::format("task '{}'", name()));
    robot_ = std::make_unique<robots::Robot>(cfg_.robot, model, num_worlds,
                                             entity.empty() ? "" : entity + "/", periods);
  } else {
    robot_ = std::make_unique<robots::Robot>(cfg_.robot, model, num_worlds, robots::Robot::kPrefix,
                                             periods);
  }
  episodes_.assign(num_worlds, {});
  if (!cfg_.starts.empty()) check_names(model, cfg_.starts, fmt::format("task '{}'", name()));
  initialize_task();
}

void Task::register_policy(Policy& policy) {
  if (this->policy()) throw ValueError("Policy already registered");
  if (!model_) throw ValueError("register_policy: initialize the task first");
  policy.initialize(*this);
  policy_ = &policy;
}

void Task::sample(int world, std::int64_t episode, const robots::StateRow& state, int draw) {
  episodes_[world] = {.number = episode};
  Rng rng(cfg_.seed, static_cast<std::uint32_t>(draw), stream("sample"),
          static_cast<std::uint64_t>(episode));
  const std::optional<Pose> base = sample_scene(world, rng, state);
  if (!samples_robot()) robot_->write_joints(state, rng);
  const GivenStart* given = given_start(world);
  if (given) {
    write_start(model_, *given, state);
    for (const auto& [group, positions] : given->robot)
      robot_->write_group(state, group, positions);
    adopt(world, *given, state);
  }
  robot_->stand(state, given && given->base ? given->base : base);
}

const GivenStart* Task::given_start(int world) const {
  const auto found = cfg_.starts.find(episode(world));
  return found == cfg_.starts.end() ? nullptr : &found->second;
}

double Task::threshold(int world, std::string_view name, double otherwise) const {
  const GivenStart* given = given_start(world);
  if (!given) return otherwise;
  const auto found = given->thresholds.find(std::string(name));
  return found == given->thresholds.end() ? otherwise : found->second;
}

void Task::adopt(int /*world*/, const GivenStart& /*start*/, const robots::StateRow& /*state*/) {
  throw ValueError(fmt::format("task '{}' cannot play episodes with given starts", name()));
}

void Task::choose_goal(int /*world*/, Rng& /*rng*/, const robots::StateRow& /*state*/) {
  throw ValueError(
      fmt::format("task '{}' cannot choose its goal in a scene that another task has sampled: when "
                  "several tasks are combined, it must be the first",
                  name()));
}

void Task::begin(const World& world) {
  if (whole_) return;
  Episode& episode = episodes_[world.id];
  episode.step = 0;
  episode.done = false;
  episode.perturbation.begin(cfg_.perturb, cfg_.seed, episode.number);
  episode.paraphrase.clear();
  if (cfg_.instructions == Instructions::kVaried) {
    Rng rng(cfg_.seed, 0, stream("instruction"), static_cast<std::uint64_t>(episode.number));
    episode.paraphrase = paraphrase(world, rng);
  }
  const GivenStart* given = given_start(world.id);
  if (given && !given->instruction.empty()) episode.paraphrase = given->instruction;
  robot_->reset(world);
}

void Task::apply(const World& world, const robots::Action& action, const robots::StateRow& state) {
  Episode& episode = episodes_[world.id];
  if (episode.perturbation.kind() == Perturbation::Kind::kNone) {
    robot_->command(world, action);
  } else {
    robots::Action disturbed = action;
    const auto of = objects(world.id);
    episode.perturbation.apply(world, *robot_, of.empty() ? -1 : of[0].body, episode.step,
                               disturbed, state);
    robot_->command(world, disturbed);
  }
  // The world's index is not part of the key: an episode is the same in every world.
  Rng noise(cfg_.seed, static_cast<std::uint32_t>(episode.step), stream_of("task/action_noise"),
            static_cast<std::uint64_t>(episode.number));
  robot_->write_ctrl(world, state, cfg_.action_noise ? &noise : nullptr);
  episode.action = action;
  episode.done = episode.done || action.done;
  ++episode.step;
}

std::uint32_t Task::stream(std::string_view what) const {
  const std::string_view name = children().empty() ? this->name() : children().front()->name();
  return stream_of(fmt::format("task/{}/{}", name, what));
}

std::size_t Task::sentence_index(int world, std::size_t count) const {
  const auto episode = static_cast<std::uint64_t>(this->episode(world));
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  Rng rng(cfg_.seed, 0, stream("sentences"), episode / count);
  for (std::size_t i = count; i > 1; --i)
    std::swap(order[i - 1], order[rng.below(static_cast<std::uint32_t>(i))]);
  return order[episode % count];
}

std::string Task::instruction(int world) const {
  const std::string& sentence = now(world).paraphrase;
  return sentence.empty() ? description(world) : sentence;
}

void Task::begin_all(ActiveWorlds& worlds) {
  worlds.for_each([this](const World& world) { begin(world); });
}

void Task::evaluate_all(ActiveWorlds& worlds, std::span<Evaluation> out) {
  worlds.for_each(
      [this, all = out.data()](const World& world) { all[world.id] = evaluate(world); });
}

Evaluation Task::make_evaluation(int world, double reward, bool success, bool over) const {
  const Episode& episode = now(world);
  return {.reward = reward,
          .success = success,
          .terminal = over || episode.done || (success && cfg_.terminate_upon_success),
          .truncated = episode.step >= cfg_.horizon};
}

Evaluation Task::make_evaluation_from(int world, double reward, std::string_view missing) const {
  Evaluation found = make_evaluation(world, reward, missing.empty());
  found.missing = missing;
  return found;
}

std::string Task::obs_scene(int world) const {
  nlohmann::ordered_json scene;
  scene["task_type"] = type();
  scene["task_description"] = description(world);
  if (cfg_.instructions == Instructions::kVaried || !now(world).paraphrase.empty())
    scene["instruction"] = instruction(world);
  scene["policy_dt_ms"] = cfg_.policy_dt_ms;
  if (const std::string name = light(world); !name.empty()) scene["light"] = name;
  auto& expressions = scene["referral_expressions"] = nlohmann::ordered_json::object();
  for (const auto& [role, referrals] : referrals(world)) {
    auto& list = expressions[role] = nlohmann::ordered_json::array();
    for (const Referral& referral : referrals)
      list.push_back({referral.text, referral.probability});
  }
  auto& bodies = scene["objects"] = nlohmann::ordered_json::object();
  const int base = robot().base_body() > 0 ? robot().base_body() : -1;
  const auto actors = observe::actors_of(model(), base);
  for (const TaskObject& object : objects(world)) {
    if (object.body < 0) continue;
    bodies[object.role]["body"] = scene::name_of(model(), mjOBJ_BODY, object.body);
    const auto actor = std::ranges::find(actors, object.body, &std::pair<int, std::string>::first);
    if (actor != actors.end()) bodies[object.role]["actor"] = actor->second;
  }
  if (policy_ && !policy_->phases().empty()) {
    auto& phases = scene["policy_phases"] = nlohmann::ordered_json::object();
    for (const Phase& phase : policy_->phases()) phases[std::string(phase.name)] = phase.number;
  }
  for (const auto& [key, value] : scene_info(world)) scene[key] = value;
  if (policy_) {
    for (const auto& [key, value] : policy_->info(world)) {
      if (scene.contains(key))
        throw ValueError(
            fmt::format("policy '{}': info() contains the key '{}', which the task already uses",
                        policy_->name(), key));
      scene[key] = value;
    }
  }
  return scene.dump();
}

}  // namespace mjsense::tasks::episode
