// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/door_opening/door_opening.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/robots/finger_grasp.h"
#include "mjsense_tasks/robots/robot_sensors.h"
#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks {
namespace {

using std::numbers::pi;

constexpr std::string_view kDoorScene = "room_with_door";
constexpr const char* kHandle = "door handle";
constexpr double kNear = 1.15, kFar = 1.9;  // m, distance of the start from the leaf
constexpr double kAside = 0.5;              // m, lateral half range of the start
constexpr double kTurned = 0.35;            // rad, half range of the start's heading
constexpr int kDoorStarts = 200;            // maximum number of sampled base placements
// {0}: the door, {1}: push or pull, {2}: pushing or pulling, {3}: away from or towards.
constexpr std::array<const char*, 14> kDoorSentences{
    "Open {0} by {2} it",
    "{1} open {0}",
    "{1} {0} open",
    "{1} {0} until it is open",
    "Please open {0}. It opens {3} you",
    "Can you open {0} by {2} it?",
    "Could you open {0}? It opens {3} you",
    "Take the handle of {0} and open it {3} you",
    "Open {0} by moving it {3} you",
    "Unlatch {0} and open it by {2}",
    "Use the handle to unlatch {0} and open it {3} you",
    "Move to {0} and open it by {2}",
    "I would like {0} to be open. It opens {3} you",
    "Go up to {0}, press its handle and open it {3} you",
};

bool mentions_handle(std::string_view text) { return text.find("handle") != text.npos; }

}  // namespace

DoorOpeningTask::DoorOpeningTask(episode::TaskCfg cfg)
    : scenes::ObjectTask(std::move(cfg), kDoorScene, kRole) {}

void DoorOpeningTask::initialize_task() {
  scenes::ObjectTask::initialize_task();
  doors_ = scenes::find_doors(model(), robot().prefix());
  if (doors_.empty())
    throw ValueError(
        fmt::format("{} has no door: no body higher than {} m on a vertical hinge with a range",
                    context(), scenes::Door::kMinHeight));
  const scenes::RestingRobot rest(model(), robot());
  sides_.clear();
  for (const scenes::Door& door : doors_)
    sides_.push_back({scenes::leaf_middle(model(), rest.data(), door),
                      scenes::opening_direction(model(), rest.data(), door)});
  footprint_ = std::make_unique<scenes::Footprint>(rest.footprint());
  trunk_ = std::make_unique<scenes::Footprint>(rest.trunk());
  const auto elsewhere = [this](int geom) { return scene().elsewhere(geom); };
  const auto of_door = [this](int geom) {
    const int body = model()->geom_bodyid[geom];
    return std::ranges::any_of(doors_, [&](const scenes::Door& door) {
      return observe::is_descendant_or_self(model(), body, door.body);
    });
  };
  floor_ = std::make_unique<scenes::OccupancyGrid>(rest.occupancy(footprint_->height(), elsewhere));
  open_floor_ = std::make_unique<scenes::OccupancyGrid>(
      rest.occupancy(footprint_->height(), elsewhere, of_door));
  if (scenes::driving_base(robot()) >= 0)
    routes_ = std::make_unique<scenes::BasePlanner>(*floor_, *footprint_);
  episodes_.assign(num_worlds(), {});
  begin_with(doors_[0].handle, kHandle, true);
}

std::optional<Pose> DoorOpeningTask::sample_scene(int world, Rng& rng,
                                                  const robots::StateRow& state) {
  Episode& episode = episodes_[world];
  const auto number = static_cast<std::uint64_t>(this->episode(world));
  episode.door = static_cast<int>(rng.below(static_cast<std::uint32_t>(doors_.size())));
  const scenes::Door& door = doors_[episode.door];
  set_object(world, door.handle, kHandle);
  vary_scene(world);
  const Pose placed = scene().sample(world, -1, cfg().seed, number, rng, state);
  state.qpos[model()->jnt_qposadr[door.joint]] = door.shut;

  // The robot starts in front of the door, on a random side, facing it up to kTurned.
  const Side& side = sides_[episode.door];
  const Vec3 along{-side.direction.y, side.direction.x, 0};
  const bool push = rng.below(2) == 0;
  for (int attempt = 0; attempt < kDoorStarts; ++attempt) {
    episode.push = attempt < kDoorStarts / 2 ? push : !push;
    const Vec3 away = episode.push ? -side.direction : side.direction;
    const Vec3 at = side.middle + (rng.uniform(kNear, kFar) + footprint_->radius() - 0.5) * away +
                    rng.uniform(-kAside, kAside) * along;
    const double yaw = std::atan2(-away.y, -away.x) + rng.uniform(-kTurned, kTurned);
    if (!footprint_->fits(*floor_, at.x, at.y, yaw, 0.08)) continue;
    return scenes::BasePose{at.x, at.y, yaw}.at_height(placed.p.z);
  }
  episode.push = dot(placed.p - side.middle, side.direction) < 0;
  return placed;
}

void DoorOpeningTask::choose_goal(int world, Rng& rng, const robots::StateRow& state) {
  Episode& episode = episodes_[world];
  adopt_scene(world, state);
  episode.door = static_cast<int>(rng.below(static_cast<std::uint32_t>(doors_.size())));
  set_object(world, door(world).handle, kHandle);
}

void DoorOpeningTask::adopt(int world, const episode::GivenStart& start,
                            const robots::StateRow& state) {
  adopt_scene(world, start, {}, state);
  const int body = body_of(start, kRole);
  const auto found = std::ranges::find_if(
      doors_, [body](const scenes::Door& d) { return d.body == body || d.handle == body; });
  if (found == doors_.end())
    throw ValueError(
        fmt::format("{}: '{}' is not a door", context(), start.objects.at(std::string(kRole))));
  episodes_[world].door = static_cast<int>(found - doors_.begin());
  set_object(world, found->handle, kHandle);
}

void DoorOpeningTask::begin(const World& world) {
  scenes::ObjectTask::begin(world);
  episodes_[world.id].push = pushes(world);
}

bool DoorOpeningTask::pushes(const World& world) const {
  const Side& side = sides_[episodes_[world.id].door];
  return dot(robot().base_pose(world).p - side.middle, side.direction) < 0;
}

episode::Evaluation DoorOpeningTask::evaluate(const World& world) const {
  const bool success = fraction(world) >= threshold(world.id, "door_openness_threshold", kOpen);
  return make_evaluation_from(world.id, success ? 1.0 : 0.0,
                              success ? "" : "the door is not open far enough");
}

std::string DoorOpeningTask::description(int world) const {
  return push(world) ? "Push the door open" : "Pull the door open";
}

std::string DoorOpeningTask::paraphrase(const World& world, Rng& rng) const {
  std::vector<std::string> doors{"the door in front of the robot", "the door in front of you"};
  // The start faces the middle of the leaf, and the handle is near one of its edges.
  if (doors_.size() == 1) {
    const Pose to_robot = inverse(robot().base_pose(world));
    const Side& side = sides_[episodes_[world.id].door];
    const double left = (to_robot * vec3(world.data->xpos + 3 * door(world.id).handle)).y -
                        (to_robot * side.middle).y;
    doors.emplace_back("the door");
    doors.emplace_back(left > 0 ? "the door with the handle on the left"
                                : "the door with the handle on the right");
  }
  const std::string_view sentence = kDoorSentences[sentence_index(world.id, kDoorSentences.size())];
  if (mentions_handle(sentence)) std::erase_if(doors, mentions_handle);
  const bool push = pushes(world);
  return fmt::format(
      fmt::runtime(sentence), doors[rng.below(static_cast<std::uint32_t>(doors.size()))],
      push ? "Push" : "Pull", push ? "pushing" : "pulling", push ? "away from" : "towards");
}

episode::Task::Referrals DoorOpeningTask::referrals(int /*world*/) const {
  return {
      {std::string(kRole), {{"door handle", 0.5}, {"handle of the door", 0.3}, {"handle", 0.2}}}};
}

void DoorOpeningTask::write_info(const World& world, JsonWriter& json) const {
  const bool grasped =
      std::ranges::any_of(robots::grippers_of(robot()), [&](const robots::MoveGroup* gripper) {
        return robots::fingers_touch(world, *gripper, door(world.id).handle);
      });
  const double open = fraction(world);
  json.key("handle_grasped").value(grasped);
  json.key("joint_position").value(open);
  json.key("success").value(open >= threshold(world.id, "door_openness_threshold", kOpen));
}

std::vector<std::pair<std::string, std::string>> DoorOpeningTask::scene_info(int world) const {
  return {{"text", description(world)}, {"object_name", "door"}};
}

}  // namespace mjsense::tasks
