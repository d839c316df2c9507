// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/nav_to_obj/nav_to_obj.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/episode/object_sensors.h"
#include "mjsense_tasks/scenes/object_references.h"
#include "mjsense_tasks/scenes/referring_expressions.h"
#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks {
namespace {

using std::numbers::pi;

constexpr std::string_view kNavScene = "floor";
constexpr const char* kCamera = "head_camera";
constexpr int kPoints = 16;
constexpr double kFarStart = 2.0;  // m, preferred minimum distance of the start from the target
constexpr int kNavStarts = 30;     // maximum number of sampled base placements
constexpr std::array<const char*, 13> kNavSentences{
    "Navigate to {}",     "Drive to {}",        "Go to {}",          "Move to {}",
    "Drive up to {}",     "Go near {}",         "Approach {}",       "Find {} and go to it",
    "Head over to {}",    "Please drive to {}", "Can you go to {}?", "Could you find {}?",
    "Find your way to {}"};

}  // namespace

NavToObjTask::NavToObjTask(episode::TaskCfg cfg)
    : scenes::ObjectTask(std::move(cfg), kNavScene, kRole) {}

// Uses the robot's head camera if it has one, otherwise its first recorded camera.
void NavToObjTask::find_camera() {
  const robots::RobotCfg& cfg = robot().cfg();
  std::vector<std::string> names{kCamera};
  for (const robots::CameraMount& mount : cfg.cameras) names.push_back(mount.mjcf_camera);
  for (const std::string& name : names) {
    const int id = mj_name2id(model(), mjOBJ_CAMERA, (robot().prefix() + name).c_str());
    if (id < 0) continue;
    line_of_sight_ = LineOfSight(model(), id, cfg.image_width, cfg.image_height);
    return;
  }
  throw ValueError(fmt::format("task 'nav_to_obj': robot '{}' has no camera, such as '{}'",
                               robot().name(), kCamera));
}

void NavToObjTask::initialize_task() {
  scenes::ObjectTask::initialize_task();
  if (scene().objects().empty())
    throw ValueError(fmt::format(
        "{} has no object to drive to: no graspable body with a free joint", context()));
  find_camera();
  points_.clear();
  for (const scenes::SceneObject& object : scene().objects())
    points_.push_back(sight_points(object.shape, kPoints));
  places_.clear();
  routes_.reset();
  if (scenes::driving_base(robot()) >= 0) {
    const scenes::RestingRobot rest(model(), robot());
    const scenes::Footprint footprint = rest.footprint();
    const scenes::OccupancyGrid floor =
        rest.occupancy(footprint.height(), [this](int geom) { return scene().elsewhere(geom); });
    routes_ = std::make_unique<scenes::BasePlanner>(floor, footprint);
    for (int row = 0; row < floor.rows(); row += 2) {
      for (int column = 0; column < floor.columns(); column += 2) {
        if (floor.clearance(floor.x(column), floor.y(row)) > 0.3)
          places_.emplace_back(floor.x(column), floor.y(row));
      }
    }
  }
  targets_.assign(num_worlds(), 0);
  begin_with(scene().objects()[0].body, scene().objects()[0].text);
}

void NavToObjTask::set_target(int world, int target) {
  targets_[world] = target;
  const scenes::SceneObject& object = scene().objects()[target];
  set_object(world, object.body, object.text);
}

bool NavToObjTask::alone(int world, int index) const {
  const auto& all = scene().objects();
  for (int i = 0; i < static_cast<int>(all.size()); ++i) {
    if (i != index && scene().present(world, i) && all[i].text == all[index].text) return false;
  }
  return true;
}

void NavToObjTask::choose_goal(int world, Rng& rng, const robots::StateRow& state) {
  std::vector<int> here = adopt_scene(world, state);
  std::vector<int> unique;
  std::ranges::copy_if(here, std::back_inserter(unique), [&](int i) { return alone(world, i); });
  if (!unique.empty()) here = std::move(unique);
  if (!here.empty()) set_target(world, here[rng.below(static_cast<std::uint32_t>(here.size()))]);
}

void NavToObjTask::adopt(int world, const episode::GivenStart& start,
                         const robots::StateRow& state) {
  set_target(world, adopt_scene(world, start, std::array{kRole}, state)[0]);
}

std::optional<Pose> NavToObjTask::sample_scene(int world, Rng& rng, const robots::StateRow& state) {
  const auto number = static_cast<std::uint64_t>(this->episode(world));
  const int n = static_cast<int>(scene().objects().size());
  vary_scene(world);
  const int first = static_cast<int>(rng.below(static_cast<std::uint32_t>(n)));
  Pose placed;
  // Try further objects if the text of the first is not unique or the robot cannot get near it.
  for (int k = 0; k < n; ++k) {
    const int target = (first + k) % n;
    if (graspable_ && scene().objects()[target].receptacle) continue;
    placed = scene().sample(world, target, cfg().seed, number, rng, state);
    set_target(world, target);
    if (!alone(world, target)) continue;
    if (!routes_) return placed;
    if (const std::optional<Pose> start = start_place(world, placed, state, rng)) return start;
  }
  return placed;
}

// A base placement from which a path leads to the target; nullopt if none is found.
std::optional<Pose> NavToObjTask::start_place(int world, const Pose& placed,
                                              const robots::StateRow& state, Rng& rng) const {
  const double* at = state.qpos + free_qpos(model(), this->object(world).body);
  const auto distance = [at](double x, double y) { return std::hypot(x - at[0], y - at[1]); };
  for (int attempt = 0; attempt < kNavStarts && !places_.empty(); ++attempt) {
    const auto [x, y] = places_[rng.below(static_cast<std::uint32_t>(places_.size()))];
    const scenes::BasePose from{x, y, rng.uniform(-pi, pi)};
    if (attempt < kNavStarts / 2 && distance(x, y) < kFarStart) continue;
    if (!routes_->free(from)) continue;
    const auto path = routes_->find(
        from, [&](const scenes::BasePose& p) { return distance(p.x, p.y) < arrived_; },
        [&](double px, double py) { return std::max(0.0, distance(px, py) - arrived_); });
    if (!path.empty()) return from.at_height(placed.p.z);
  }
  return {};
}

// An object behind furniture may be close to a path without being visible from any point of it.
std::string NavToObjTask::start_error(const World& world) const {
  std::string fault = scenes::ObjectTask::start_error(world);
  if (!fault.empty()) return fault;
  if (!alone(world.id, targets_[world.id]))
    return fmt::format(
        "{} has several objects named '{}', none of which has a unique text: give them different "
        "texts",
        context(), object(world.id).name);
  if (!routes_) return "";
  const Pose base = robot().base_pose(world), camera = inverse(base) * camera_pose(world);
  const auto seen = [&](const scenes::BasePose& p) {
    return distance(world, p.x, p.y) < kNearby && sees(world, p.at_height(base.p.z) * camera);
  };
  const auto left = [&](double x, double y) {
    return std::max(0.0, distance(world, x, y) - kNearby);
  };
  if (!routes_->find(scenes::BasePose::of(base), seen, left).empty()) return "";
  return fmt::format(
      "task '{}': robot '{}' cannot see the {} in scene '{}' from any base pose that it can reach",
      name(), robot().name(), object(world.id).name, scene().cfg().name);
}

double NavToObjTask::distance(const World& world, double x, double y) const {
  const double* at = world.data->xpos + 3 * object(world.id).body;
  return std::hypot(at[0] - x, at[1] - y);
}

bool NavToObjTask::sees(const World& world, const Pose& camera) const {
  const int index = targets_[world.id];
  const auto with = [&](std::span<const Vec3> points) {
    return line_of_sight_.sees(world.model, world.data, camera, object(world.id).body, points);
  };
  const double size = scene().size(world.id, index);
  if (size == 1) return with(points_[index]);
  std::vector<Vec3> points;
  for (Vec3 p : points_[index]) points.push_back(size * p);
  return with(points);
}

NavToObjTask::Assessment NavToObjTask::assessment(const World& world) const {
  const Vec3 base = robot().base_pose(world).p;
  Assessment out{distance(world, base.x, base.y), 0};
  if (out.distance < kReach && sees(world, camera_pose(world)))
    out.reward = 1 - out.distance / kReach;
  return out;
}

episode::Evaluation NavToObjTask::evaluate(const World& world) const {
  const Assessment now = assessment(world);
  return make_evaluation_from(world.id, now.reward,
                              now.reward > 0          ? ""
                              : now.distance < kReach ? "the camera does not see the object"
                                                      : "the object is too far away");
}

std::string NavToObjTask::description(int world) const {
  return "Navigate to the " + object(world).name;
}

std::string NavToObjTask::paraphrase(const World& world, Rng& rng) const {
  const std::string object =
      scenes::draw_reference(scenes::object_references(world, scene(), targets_[world.id],
                                                       robot().base_pose(world), {}, true),
                             rng);
  const char* sentence = kNavSentences[sentence_index(world.id, kNavSentences.size())];
  return object.empty() ? "" : fmt::format(fmt::runtime(sentence), object);
}

episode::Task::Referrals NavToObjTask::referrals(int world) const {
  return {{"object_name", scenes::referring_expressions(scene().objects()[targets_[world]])}};
}

void NavToObjTask::write_info(const World& world, JsonWriter& json) const {
  const Assessment now = assessment(world);
  json.key("position_error").value(now.distance);
  json.key("success").value(now.reward > 0);
}

std::vector<std::shared_ptr<Sensor>> NavToObjTask::create_task_sensors() const {
  std::vector<episode::NamedBody> bodies;
  for (int i = 0; i < static_cast<int>(scene().objects().size()); ++i) {
    const int body = scene().objects()[i].body;
    bodies.push_back({mjsense::scene::name_of(model(), mjOBJ_BODY, body),
                      [this, i, body](int world) { return targets_[world] == i ? body : -1; }});
  }
  return {episode::body_poses_sensor(*this, "pickup_obj_pose", std::move(bodies))};
}

std::vector<std::pair<std::string, std::string>> NavToObjTask::scene_info(int world) const {
  return {{"text", description(world)}, {"object_name", object(world).name}};
}

}  // namespace mjsense::tasks
