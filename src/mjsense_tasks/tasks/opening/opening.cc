// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/opening.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/scenes/object_references.h"

namespace mjsense::tasks {
namespace {

constexpr std::string_view kOpeningScene = "kitchen";
// Fractions of the range that planners aim at: a drawer is pulled far out, and a door is swung
// until it is clearly open.
constexpr double kAimSlide = 0.55, kAimHinge = 0.38;
constexpr double kBeyond =
    0.06;  // minimum margin beyond the success threshold, fraction of the range
// The base placement varies slightly between episodes.
constexpr double kSpread = 0.02, kTurn = 0.05;  // m, rad
constexpr int kTries = 12;                      // maximum number of grasps tried from a placement
constexpr double kApart = 0.08;  // m, minimum distance along a direction that an instruction names
constexpr std::array<const char*, 24> kOpenSentences{
    "Open {}",
    "Open up {}",
    "Pull {} open",
    "Please open {}",
    "Can you open {}?",
    "Could you open {} for me?",
    "Open {} by its handle",
    "Take the handle of {} and open it",
    "Grasp the handle of {} and pull it open",
    "Make sure that {} is open",
    "I would like {} to be open",
    "Try to open {}",
    "Open {}, please",
    "Reach for {} and open it",
    "I need to get into {}. Please open it",
    "Would you open {}?",
    "Get {} open",
    "Go ahead and open {}",
    "Leave {} open",
    "Pull at the handle of {} until it is open",
    "Use the handle to open {}",
    "Hold {} by its handle and pull",
    "Please pull {} open",
    "Your task is to open {}",
};
constexpr std::array<const char*, 24> kCloseSentences{
    "Close {}",
    "Shut {}",
    "Push {} shut",
    "Push {} closed",
    "Please close {}",
    "Please shut {}",
    "Can you close {}?",
    "Could you shut {} for me?",
    "Make sure that {} is closed",
    "I would like {} to be closed",
    "Try to close {}",
    "Close {} again",
    "Close {}, please",
    "Reach for {} and close it",
    "I am done with {}. Please close it",
    "Would you close {}?",
    "Get {} closed",
    "Go ahead and shut {}",
    "Leave {} closed",
    "Push {} until it is closed",
    "Use the handle to close {}",
    "Take the handle of {} and push it shut",
    "Please push {} shut",
    "Your task is to close {}",
};

}  // namespace

OpeningTask::OpeningTask(episode::TaskCfg cfg, OpeningKind kind)
    : scenes::ObjectTask(std::move(cfg), kOpeningScene, kRole), kind_(kind) {}

void OpeningTask::initialize_task() {
  scenes::ObjectTask::initialize_task();
  articulations_ = find_articulations(model(), robot_entity() + "/");
  if (articulations_.empty())
    throw ValueError(fmt::format(
        "{} has nothing to open: no hinge or slide joint with a range and a handle", context()));
  reach_ = std::make_unique<HandleReach>(model(), robot());
  const DataPtr data = make_data(model());
  if (start_key() >= 0) mj_resetDataKeyframe(model(), data.get(), start_key());
  const robots::StateRow empty = robots::state_row(data.get());
  const Pose usual = scene().clear(empty);
  for (const Articulation& one : articulations_) empty.qpos[one.qpos] = one.closed;
  bases_ = std::make_unique<BaseSearch>(robot(), *reach_, reach_->start_of(*model(), empty), usual);
  targets_.assign(num_worlds(), {});
  begin_with(articulations_[0].body, articulations_[0].text);
}

std::map<std::string, double> OpeningTask::thresholds() const {
  return {{"task_success_threshold", kind_ == OpeningKind::kOpen ? opened() : kClosed},
          {"any_inst_of_category", kind_ == OpeningKind::kOpen ? 1 : 0}};
}

double OpeningTask::aim(const Articulation& one) const {
  if (kind_ == OpeningKind::kClose) return one.closed;
  return one.at(std::max(one.slide ? kAimSlide : kAimHinge, opened() + kBeyond));
}

std::optional<OpeningTask::Found> OpeningTask::find_base(const Articulation& one, double from,
                                                         const HandleReach::Start& start,
                                                         Rng& rng) const {
  const double to = aim(one);
  // Base placements are searched once, for the middle of the range of start positions.
  const double middle =
      kind_ == OpeningKind::kOpen ? one.closed : one.at(0.5 * (kMinStart + kMaxStart));
  BasePlaces places = bases_->places(one, middle, to);
  while (!places.at.empty()) {
    const auto k = rng.below(static_cast<std::uint32_t>(places.at.size()));
    const Pose place = places.at[k];
    places.at.erase(places.at.begin() + k);
    const Vec3 move{rng.uniform(-kSpread, kSpread), rng.uniform(-kSpread, kSpread), 0};
    const double turn = rng.uniform(-kTurn, kTurn);
    const Pose moved{place.p + move, normalized(axis_angle({0, 0, 1}, turn) * place.q)};
    for (const Pose& base : {moved, place}) {
      const HandleReach::Start there = bases_->placed(start, base);
      if (reach_->is_collision_free(there) &&
          reach_->find(there, one, from, to, kTries, places.driving))
        return Found{base, places.driving};
    }
  }
  return {};
}

std::optional<Pose> OpeningTask::sample_scene(int world, Rng& rng, const robots::StateRow& state) {
  const auto episode = static_cast<std::uint64_t>(this->episode(world));
  vary_scene(world);
  const Pose usual = scene().sample(world, -1, cfg().seed, episode, rng, state);
  for (const Articulation& one : articulations_) state.qpos[one.qpos] = one.closed;

  // Categories are equally likely, and so are the articulations within a category. If a target
  // cannot be reached, the next one in this random order is used.
  std::vector<std::string> categories;
  for (const Articulation& one : articulations_) {
    if (std::ranges::find(categories, one.category) == categories.end())
      categories.push_back(one.category);
  }
  std::vector<int> order;
  std::vector<std::vector<int>> left(categories.size());
  for (std::size_t i = 0; i < articulations_.size(); ++i) {
    const auto c = std::ranges::find(categories, articulations_[i].category) - categories.begin();
    left[c].push_back(static_cast<int>(i));
  }
  while (!left.empty()) {
    const auto c = rng.below(static_cast<std::uint32_t>(left.size()));
    const auto k = rng.below(static_cast<std::uint32_t>(left[c].size()));
    order.push_back(left[c][k]);
    left[c].erase(left[c].begin() + k);
    if (left[c].empty()) left.erase(left.begin() + c);
  }
  const mjModel here = world_model(world);
  Target& target = targets_[world];
  target.reached = false;
  std::optional<Found> base;
  for (int index : order) {
    const Articulation& one = articulations_[index];
    const double from =
        kind_ == OpeningKind::kOpen ? one.closed : one.at(rng.uniform(kMinStart, kMaxStart));
    base = find_base(one, from, reach_->start_of(here, state), rng);
    if (!base && index != order.back()) continue;
    target.index = index;
    target.reached = base.has_value();
    target.driving = base && base->driving;
    set_object(world, one.body, one.text);
    state.qpos[one.qpos] = from;
    state.qvel[one.dof] = 0;
    break;
  }
  return base ? base->base : usual;
}

void OpeningTask::adopt(int world, const episode::GivenStart& start,
                        const robots::StateRow& state) {
  adopt_scene(world, start, {}, state);
  const int body = body_of(start, kRole);
  const auto is_part = [&](const Articulation& one) {
    int b = one.body;
    while (b > 0 && b != body) b = model()->body_parentid[b];
    return b > 0 && start.joints.contains(scene::name_of(model(), mjOBJ_JOINT, one.joint));
  };
  auto found = std::ranges::find(articulations_, body, &Articulation::body);
  if (found == articulations_.end()) found = std::ranges::find_if(articulations_, is_part);
  if (found == articulations_.end())
    throw ValueError(fmt::format("{}: '{}' has no joint with a range and a handle", context(),
                                 start.objects.at(std::string(kRole))));
  Target& target = targets_[world];
  const int index = static_cast<int>(found - articulations_.begin());
  target.driving = target.driving && target.index == index;
  target.index = index;
  target.reached = true;  // whether the robot reaches it is up to the given start
  set_object(world, found->body, found->text);
}

void OpeningTask::begin(const World& world) {
  scenes::ObjectTask::begin(world);
  Target& target = targets_[world.id];
  const Articulation& one = articulations_[target.index];
  const double wanted = kind_ == OpeningKind::kOpen ? one.at(opened()) : one.at(1 - kClosed);
  target.goal =
      one.motion(world.data->qpos[one.qpos], wanted, vec3(world.data->xaxis + 3 * one.joint),
                 vec3(world.data->xanchor + 3 * one.joint)) *
      start(world.id);
}

std::string OpeningTask::start_error(const World& world) const {
  const std::string fault = scene().fault(world);
  if (!fault.empty()) return fault;
  const Target& target = targets_[world.id];
  if (target.reached) return "";
  return fmt::format(
      "task '{}': robot '{}' cannot reach a handle in scene '{}' from any base pose; the last one "
      "tried was '{}'",
      name(), robot().name(), scene().cfg().name, articulations_[target.index].name);
}

double OpeningTask::reward(const World& world) const {
  const Articulation& target = articulations_[targets_[world.id].index];
  if (kind_ == OpeningKind::kClose) return 1 - target.fraction(world.data->qpos[target.qpos]);
  if (threshold(world.id, "any_inst_of_category", 1) == 0)
    return target.fraction(world.data->qpos[target.qpos]);
  double maximum = 0;
  for (const Articulation& one : articulations_) {
    if (one.category == target.category)
      maximum = std::max(maximum, one.fraction(world.data->qpos[one.qpos]));
  }
  return maximum;
}

bool OpeningTask::succeeded(int world, double reward) const {
  return reward >= threshold(world, "task_success_threshold",
                             kind_ == OpeningKind::kOpen ? opened() : kClosed);
}

episode::Evaluation OpeningTask::evaluate(const World& world) const {
  const double reward = this->reward(world);
  return make_evaluation_from(world.id, reward,
                              succeeded(world.id, reward)   ? ""
                              : kind_ == OpeningKind::kOpen ? "it is not open far enough"
                                                            : "it is not closed far enough");
}

std::string OpeningTask::description(int world) const {
  return fmt::format("{} the {}", kind_ == OpeningKind::kOpen ? "Open" : "Close",
                     object(world).name);
}

// Phrases for the target that fit no other articulation with its name. Left and right are the
// robot's.
std::vector<std::string> OpeningTask::references(const World& world) const {
  const Articulation& target = articulations_[targets_[world.id].index];
  const Pose to_robot = inverse(robot().base_pose(world));
  const auto handle = [&](const Articulation& one) {
    const Pose body = body_pose(world.data, one.body);
    return to_robot * (body * one.handle.middle);
  };
  std::vector<Vec3> others;
  for (const Articulation& one : articulations_) {
    if (one.joint != target.joint && one.text == target.text) others.push_back(handle(one));
  }
  if (others.empty()) return {"the " + target.text};
  std::vector<std::string> found;
  // Any of them may be opened. Of those to be closed, one is open.
  if (kind_ == OpeningKind::kOpen) {
    found.push_back((target.text[0] == 'o' ? "an " : "a ") + target.text);
    found.push_back(fmt::format("one of the {}s", target.text));
  } else {
    found.push_back("the open " + target.text);
  }
  const bool two = others.size() == 1;
  const Vec3 at = handle(target);
  const auto add = [&](const char* of_two, const char* of_many, double Vec3::*axis, double sign) {
    if (std::ranges::all_of(others, [&](Vec3 p) { return sign * (at.*axis - p.*axis) > kApart; }))
      found.push_back(fmt::format("the {} {}", two ? of_two : of_many, target.text));
  };
  add("left", "leftmost", &Vec3::y, 1);
  add("right", "rightmost", &Vec3::y, -1);
  add("upper", "highest", &Vec3::z, 1);
  add("lower", "lowest", &Vec3::z, -1);
  return found;
}

std::string OpeningTask::paraphrase(const World& world, Rng& rng) const {
  const std::vector<std::string> all = references(world);
  const std::string& object = all[rng.below(static_cast<std::uint32_t>(all.size()))];
  const auto& sentences = kind_ == OpeningKind::kOpen ? kOpenSentences : kCloseSentences;
  return fmt::format(fmt::runtime(sentences[sentence_index(world.id, sentences.size())]), object);
}

episode::Task::Referrals OpeningTask::referrals(int world) const {
  return {{"pickup_obj_name", {{object(world).name, 1.0}}}};
}

std::optional<Pose> OpeningTask::goal_pose(int world, std::string_view role) const {
  (void)start_pose(world, role);
  return targets_[world].goal;
}

void OpeningTask::write_info(const World& world, JsonWriter& json) const {
  const Articulation& target = articulations_[targets_[world.id].index];
  const auto first = std::ranges::find(articulations_, target.category, &Articulation::category);
  json.key("episode_step").value(episode_step(world.id));
  json.key("joint_position").value(world.data->qpos[first->qpos]);
  json.key("success").value(succeeded(world.id, reward(world)));
}

}  // namespace mjsense::tasks
