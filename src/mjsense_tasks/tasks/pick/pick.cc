// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/pick/pick.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "mjsense/core/error.h"
#include "mjsense/observe/touches.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/scenes/object_references.h"
#include "mjsense_tasks/scenes/referring_expressions.h"
#include "mjsense_tasks/tasks/pick_and_place/support_check.h"

namespace mjsense::tasks {
namespace {

using std::numbers::pi;

constexpr std::string_view kPickScene = "varied_table";
constexpr double kLift = 0.01;      // m, lift at which the task succeeds
constexpr double kPickGoal = 0.05;  // m, goal above the start
constexpr std::array<const char*, 15> kPickSentences{"Pick up {}",
                                                     "Pick up {} for me",
                                                     "Lift {}",
                                                     "Lift up {}",
                                                     "Grasp {} and lift it",
                                                     "Grab {}",
                                                     "Take {}",
                                                     "Take hold of {} and raise it",
                                                     "Get {}",
                                                     "Please pick up {}",
                                                     "Can you pick up {}?",
                                                     "Could you lift {} for me?",
                                                     "I need {}. Please pick it up",
                                                     "Reach for {} and pick it up",
                                                     "Raise {}"};

}  // namespace

PickTask::PickTask(episode::TaskCfg cfg) : scenes::ObjectTask(std::move(cfg), kPickScene, kRole) {}

std::map<std::string, double> PickTask::thresholds() const {
  return {{"succ_pos_threshold", kLift}};
}

void PickTask::initialize_task() {
  scenes::ObjectTask::initialize_task();
  things_ = scene().pickup_objects();
  if (things_.empty())
    throw ValueError(
        fmt::format("{} has no object to pick up: no graspable body with a free joint", context()));
  objects_.clear();
  for (const scenes::SceneObject& object : scene().objects())
    objects_.push_back({object.body, object.kind, object.shape});
  targets_.assign(num_worlds(), 0);
  begin_with(objects_[0].body, scene().objects()[0].text);
  standing_ = scenes::BasePlacementSearch(model(), robot(), scene());
  robot_root_ = model()->body_rootid[robot().base_body()];
}

std::optional<Pose> PickTask::sample_scene(int world, Rng& rng, const robots::StateRow& state) {
  const auto episode = static_cast<std::uint64_t>(this->episode(world));
  vary_scene(world);
  const int target = scene().draw(world, things_, robot(), rng);
  set_target(world, target);
  return standing_(scene().sample(world, target, cfg().seed, episode, rng, state));
}

void PickTask::choose_goal(int world, Rng& rng, const robots::StateRow& state) {
  std::vector<int> here = adopt_scene(world, state);
  std::erase_if(here, [this](int i) { return scene().objects()[i].receptacle; });
  if (here.empty()) here = things_;
  const int target = scene().draw(world, here, robot(), rng);
  set_target(world, target);
  scene().set_target(world, target, state);
}

void PickTask::choose_object(int world, int body, const robots::StateRow& state) {
  adopt_scene(world, state);
  const auto found = std::ranges::find(things_, body, [this](int i) { return objects_[i].body; });
  if (found == things_.end())
    throw ValueError(fmt::format("{}: '{}' cannot be picked up", context(),
                                 mjsense::scene::name_of(model(), mjOBJ_BODY, body)));
  set_target(world, *found);
  scene().set_target(world, *found, state);
}

void PickTask::adopt(int world, const episode::GivenStart& start, const robots::StateRow& state) {
  const int target = adopt_scene(world, start, std::array{kRole}, state)[0];
  set_target(world, target);
  scene().set_target(world, target, state);
}

void PickTask::set_target(int world, int target) {
  const scenes::SceneObject& object = scene().objects()[target];
  targets_[world] = target;
  set_object(world, object.body, object.text);
}

// True if the first contact that supports the object from below is with a body other than the
// robot. A supporting contact is below the middle of the object, with a normal within 80 degrees of
// up.
bool PickTask::supported_by_others(const World& world, int body) const {
  const double middle = world_box(world, body).center().z;
  const double steep = std::cos(80.0 / 180.0 * pi);
  std::optional<bool> by_others;
  observe::each_touch(world, body, [&](const observe::Touch& touch) {
    const bool supports =
        touch.contact->pos[2] < middle && touch.sign * touch.contact->frame[2] >= steep;
    if (supports && !by_others) by_others = world.model->body_rootid[touch.other] != robot_root_;
  });
  return by_others.value_or(false);
}

// The unmet condition of success; "" if only the robot holds the object in the air.
std::string_view PickTask::missing(const World& world) const {
  const int body = object(world.id).body;
  if (world.data->xpos[3 * body + 2] - start(world.id).p.z <
      threshold(world.id, "succ_pos_threshold", kLift))
    return "the object is not lifted";
  bool held = false, others = false;
  observe::each_touch(world, body, [&](const observe::Touch& touch) {
    (world.model->body_rootid[touch.other] == robot_root_ ? held : others) = true;
  });
  if (others) return "something other than the robot touches the object";
  return held ? "" : "the robot does not touch the object";
}

episode::Evaluation PickTask::evaluate(const World& world) const {
  const int body = object(world.id).body;
  const double height = world.data->xpos[3 * body + 2] - start(world.id).p.z;
  const double reward = supported_by_others(world, body) ? 0.0 : std::clamp(height, 0.0, 1000.0);
  return make_evaluation_from(world.id, reward, missing(world));
}

std::string PickTask::description(int world) const { return "Pick up the " + object(world).name; }

std::string PickTask::paraphrase(const World& world, Rng& rng) const {
  const std::string object = scenes::draw_reference(
      scenes::object_references(world, scene(), targets_[world.id], robot().base_pose(world)), rng);
  const char* sentence = kPickSentences[sentence_index(world.id, kPickSentences.size())];
  return object.empty() ? "" : fmt::format(fmt::runtime(sentence), object);
}

episode::Task::Referrals PickTask::referrals(int world) const {
  return {{"pickup_obj_name", scenes::referring_expressions(scene().objects()[targets_[world]])}};
}

std::optional<Pose> PickTask::goal_pose(int world, std::string_view role) const {
  Pose pose = start_pose(world, role);
  pose.p.z += kPickGoal;
  return pose;
}

void PickTask::write_info(const World& world, JsonWriter& json) const {
  const int body = object(world.id).body;
  const Vec3 goal = start(world.id).p + Vec3{0, 0, kPickGoal};
  json.key("episode_step").value(episode_step(world.id));
  json.key("position_error").value(norm(vec3(world.data->xpos + 3 * body) - goal));
  json.key("rotation_error")
      .value(angle_between(start(world.id).q, quat(world.data->xquat + 4 * body)));
  json.key("success").value(missing(world).empty());
}

std::vector<std::pair<std::string, std::string>> PickTask::scene_info(int world) const {
  return {{"text", description(world)}, {"object_name", object(world).name}};
}

}  // namespace mjsense::tasks
