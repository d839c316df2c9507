// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/multi_task/multi_task.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"

namespace mjsense::tasks {
namespace {

constexpr std::array<const char*, 4> kIntroductions{"", "Do one of these. ", "Choose one. ",
                                                    "One of these will do. "};
constexpr std::array<const char*, 3> kJoints{"Or: ", "Alternatively: ", "Otherwise: "};

}  // namespace

MultiTask::MultiTask(std::string name, episode::TaskCfg cfg,
                     std::vector<std::unique_ptr<episode::Task>> children)
    : episode::Task(std::move(cfg)), name_(std::move(name)), children_(std::move(children)) {
  if (size() < 2)
    throw ValueError(
        fmt::format("task '{}' consists of {} task, at least two are required", name_, size()));
  for (int i = 0; i < size(); ++i) {
    const episode::TaskCfg& own = children_[i]->cfg();
    if (own.scene != this->cfg().scene || own.robot.name != this->cfg().robot.name)
      throw ValueError(
          fmt::format("task '{}': its task '{}' has scene '{}' and robot '{}', but the combined "
                      "task has '{}' and '{}'",
                      name_, children_[i]->name(), own.scene, own.robot.name, this->cfg().scene,
                      this->cfg().robot.name));
    const std::string base(children_[i]->name());
    std::string unique = base;
    for (int n = 2; std::ranges::count(names_, unique, &std::pair<std::string, int>::first) > 0;
         ++n)
      unique = fmt::format("{}_{}", base, n);
    names_.emplace_back(unique, i);
    children_[i]->whole_ = this;
  }
  std::ranges::sort(names_);
}

void MultiTask::initialize_task() {
  for (const auto& child : children_) child->initialize(model(), num_worlds());
  success_.assign(num_worlds(), 0);
  found_.assign(static_cast<std::size_t>(size()) * num_worlds(), {});
  objects_.assign(num_worlds(), {});
  for (int w = 0; w < num_worlds(); ++w) collect_objects(w);
}

void MultiTask::collect_objects(int world) {
  std::vector<episode::TaskObject>& all = objects_[world];
  all.clear();
  for (const auto& child : children_) {
    for (const episode::TaskObject& object : child->objects(world)) {
      if (std::ranges::count(all, object.role, &episode::TaskObject::role) == 0)
        all.push_back(object);
    }
  }
}

// The first child samples the same episode that it would sample as the only task.
std::optional<Pose> MultiTask::sample_scene(int world, Rng& rng, const robots::StateRow& state) {
  for (const auto& child : children_) child->reseed(cfg().seed);
  const std::optional<Pose> base = children_[0]->sample_scene(world, rng, state);
  choose_goals(world, state);
  collect_objects(world);
  return base;
}

void MultiTask::choose_goals(int world, const robots::StateRow& state) {
  for (int i = 1; i < size(); ++i) {
    Rng goal(cfg().seed, static_cast<std::uint32_t>(i), stream_of("task/goal"),
             static_cast<std::uint64_t>(episode(world)));
    children_[i]->choose_goal(world, goal, state);
  }
}

void MultiTask::begin(const World& world) {
  episode::Task::begin(world);
  for (const auto& child : children_) child->begin(world);
  success_[world.id] = 0;
}

void MultiTask::begin_all(episode::ActiveWorlds& worlds) {
  worlds.for_each([this](const World& world) {
    episode::Task::begin(world);
    success_[world.id] = 0;
  });
  for (const auto& child : children_) child->begin_all(worlds);
}

void MultiTask::advance() {
  for (const auto& child : children_) child->advance();
}

episode::Evaluation MultiTask::combined(int world, std::span<const episode::Evaluation> of_children,
                                        std::size_t stride) const {
  double reward = of_children[0].reward;
  bool success = false, over = false;
  for (std::size_t i = 0; i < of_children.size(); i += stride) {
    reward = std::max(reward, of_children[i].reward);
    success = success || of_children[i].success;
    over = over || of_children[i].terminal;
  }
  episode::Evaluation all = make_evaluation(world, reward, success, over);
  if (!success) all.missing = of_children[0].missing;
  return all;
}

episode::Evaluation MultiTask::judge(int world, std::span<const episode::Evaluation> of_children,
                                     std::size_t stride) const {
  const episode::Evaluation all = combined(world, of_children, stride);
  success_[world] = all.success ? 1 : 0;
  return all;
}

episode::Evaluation MultiTask::evaluate(const World& world) const {
  std::vector<episode::Evaluation> found;
  for (const auto& child : children_) found.push_back(child->evaluate(world));
  return judge(world.id, found, 1);
}

void MultiTask::evaluate_all(episode::ActiveWorlds& worlds, std::span<episode::Evaluation> out) {
  const std::span<episode::Evaluation> all(found_);
  const auto B = static_cast<std::size_t>(num_worlds());
  for (int i = 0; i < size(); ++i) children_[i]->evaluate_all(worlds, all.subspan(i * B, B));
  for (int w : worlds.ids()) out[w] = judge(w, all.subspan(w), B);
}

std::string MultiTask::description(int world) const {
  std::string text;
  for (const auto& child : children_)
    text += (text.empty() ? "" : " OR ") + child->description(world);
  return text;
}

// The children's sentences, such as "Either of the two will do. Drive to the mug. Or: Lift the pear".
std::string MultiTask::paraphrase(const World& world, Rng& rng) const {
  std::string text = kIntroductions[rng.below(kIntroductions.size())];
  const char* joint = kJoints[rng.below(kJoints.size())];
  for (int i = 0; i < size(); ++i) {
    std::string part = paraphrase_of(i, world, rng);
    if (part.empty()) part = children_[i]->description(world.id);
    if (i > 0) text += text.ends_with('?') ? " " : ". ";
    text += i > 0 ? joint + part : part;
  }
  return text;
}

std::string MultiTask::paraphrase_of(int child, const World& world, Rng& rng) const {
  return children_[child]->paraphrase(world, rng);
}

episode::Task::Referrals MultiTask::referrals(int world) const {
  Referrals all;
  for (const auto& child : children_) {
    for (auto& [role, texts] : child->referrals(world)) {
      const auto has = [&r = role](const auto& other) { return other.first == r; };
      if (std::ranges::none_of(all, has)) all.emplace_back(role, std::move(texts));
    }
  }
  return all;
}

// The child that has an object with this role. Throws KeyError for an unknown role.
const episode::Task& MultiTask::with_role(std::string_view role) const {
  for (const auto& child : children_) {
    if (std::ranges::count(child->objects(0), role, &episode::TaskObject::role) > 0) return *child;
  }
  throw_unknown(fmt::format("task '{}'", name_), "role", role,
                names_of(objects_[0], &episode::TaskObject::role));
}

Pose MultiTask::start_pose(int world, std::string_view role) const {
  return with_role(role).start_pose(world, role);
}

std::optional<Pose> MultiTask::goal_pose(int world, std::string_view role) const {
  return with_role(role).goal_pose(world, role);
}

void MultiTask::write_info(const World& world, JsonWriter& json) const {
  json.key("success").value(success_[world.id] != 0);
  json.key("tasks").begin_object();
  for (const auto& [name, index] : names_) {
    json.key(name).begin_object();
    children_[index]->write_info(world, json);
    json.end_object();
  }
  json.end_object();
}

std::vector<std::shared_ptr<Sensor>> MultiTask::create_task_sensors() const {
  std::vector<std::shared_ptr<Sensor>> all;
  for (const auto& child : children_) {
    for (auto& sensor : child->create_task_sensors()) {
      const auto same = [&](const auto& other) { return other->name() == sensor->name(); };
      if (std::ranges::none_of(all, same)) all.push_back(std::move(sensor));
    }
  }
  return all;
}

const episode::GraspScene* MultiTask::grasp_scene() const {
  for (const auto& child : children_) {
    if (const episode::GraspScene* scene = child->grasp_scene()) return scene;
  }
  return nullptr;
}

// Scene information of the first child, with the text of all children.
std::vector<std::pair<std::string, std::string>> MultiTask::scene_info(int world) const {
  auto info = children_[0]->scene_info(world);
  for (auto& [key, value] : info) {
    if (key == "text") value = description(world);
  }
  return info;
}

}  // namespace mjsense::tasks
