// SPDX-License-Identifier: Apache-2.0
#include "mjsense/tasks/nav_to_obj/nav_to_obj.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/episode/object_sensors.h"
#include "mjsense/scene/resolve.h"
#include "mjsense/scenes/object_texts.h"
#include "mjsense/scenes/robot_floor.h"

namespace mjsense {
namespace {

using std::numbers::pi;

constexpr std::string_view kScene = "floor";
constexpr const char* kCamera = "head_camera";
constexpr int kPoints = 16;
constexpr double kFarStart = 2.0;  // m, from every candidate, where there is such a place
constexpr double kArrived = 1.35;  // m, of a way that shows that a start can be played
constexpr int kStarts = 30;        // places to try

}  // namespace

NavToObjTask::NavToObjTask(TaskCfg cfg) : ObjectTask(std::move(cfg), kScene, kRole) {}

// The robot's head camera, else the first that it records.
void NavToObjTask::find_camera() {
  const RobotCfg& cfg = robot().cfg();
  std::vector<std::string> names{kCamera};
  for (const CameraMount& mount : cfg.cameras) names.push_back(mount.mjcf_camera);
  for (const std::string& name : names) {
    const int id = mj_name2id(model(), mjOBJ_CAMERA, (robot().prefix() + name).c_str());
    if (id < 0) continue;
    sight_ = Sight(model(), id, cfg.image_width, cfg.image_height);
    return;
  }
  throw ValueError(
      fmt::format("task 'nav_to_obj': robot '{}' has no camera, neither '{}' nor another",
                  robot().name(), kCamera));
}

void NavToObjTask::initialize_task() {
  ObjectTask::initialize_task();
  if (scene().objects().empty())
    throw ValueError(fmt::format(
        "{} has nothing to drive to: no body with a free joint that a hand can hold", place()));
  find_camera();
  points_.clear();
  for (const SceneObject& object : scene().objects())
    points_.push_back(sight_points(object.shape, kPoints));
  places_.clear();
  routes_.reset();
  if (driving_base(robot()) >= 0) {
    const RestingRobot rest(model(), robot());
    const Footprint footprint = rest.footprint();
    const Occupancy floor =
        rest.occupancy(footprint.height(), [this](int geom) { return scene().elsewhere(geom); });
    routes_ = std::make_unique<BaseRoutes>(floor, footprint);
    for (int row = 0; row < floor.rows(); row += 2) {
      for (int column = 0; column < floor.columns(); column += 2) {
        if (floor.clearance(floor.x(column), floor.y(row)) > 0.3)
          places_.emplace_back(floor.x(column), floor.y(row));
      }
    }
  }
  candidates_.assign(num_worlds(), {0});
  for (std::vector<int>& candidates : candidates_) candidates.reserve(scene().objects().size());
  begin_with(scene().objects()[0].body, scene().objects()[0].text);
}

void NavToObjTask::set_goal(int world, int target) {
  const auto& all = scene().objects();
  candidates_[world].assign(1, target);
  for (int i = 0; i < static_cast<int>(all.size()); ++i) {
    if (i != target && scene().present(world, i) && all[i].text == all[target].text)
      candidates_[world].push_back(i);
  }
  set_object(world, all[target].body, all[target].text);
}

void NavToObjTask::choose_goal(int world, Rng& rng, const StateRow& state) {
  const std::vector<int> here = adopt_scene(world, state);
  if (!here.empty()) set_goal(world, here[rng.below(static_cast<std::uint32_t>(here.size()))]);
}

std::optional<Pose> NavToObjTask::sample_scene(int world, Rng& rng, const StateRow& state) {
  const auto number = static_cast<std::uint64_t>(this->episode(world));
  const int n = static_cast<int>(scene().objects().size());
  vary_scene(world);
  const int first = static_cast<int>(rng.below(static_cast<std::uint32_t>(n)));
  Pose placed;
  for (int k = 0; k < n; ++k) {  // another one, where the robot cannot come near the first
    const int target = (first + k) % n;
    placed = scene().sample(world, target, cfg().seed, number, rng, state);
    set_goal(world, target);
    if (!routes_) return placed;
    if (const std::optional<Pose> start = start_place(world, placed, state, rng)) return start;
  }
  return placed;
}

// Somewhere from where there is a way to a candidate, if there is such a place.
std::optional<Pose> NavToObjTask::start_place(int world, const Pose& placed, const StateRow& state,
                                              Rng& rng) const {
  const auto distance = [&](double x, double y) {
    double least = 1e10;
    for (int i : candidates(world)) {
      const double* at =
          state.qpos + model()->jnt_qposadr[model()->body_jntadr[scene_object(i).body]];
      least = std::min(least, std::hypot(x - at[0], y - at[1]));
    }
    return least;
  };
  for (int attempt = 0; attempt < kStarts && !places_.empty(); ++attempt) {
    const auto [x, y] = places_[rng.below(static_cast<std::uint32_t>(places_.size()))];
    const BasePose from{x, y, rng.uniform(-pi, pi)};
    if (attempt < kStarts / 2 && distance(x, y) < kFarStart) continue;
    if (!routes_->free(from)) continue;
    const auto way = routes_->find(
        from, [&](const BasePose& p) { return distance(p.x, p.y) < kArrived; },
        [&](double px, double py) { return std::max(0.0, distance(px, py) - kArrived); });
    if (!way.empty()) return Pose{{x, y, placed.p.z}, axis_angle({0, 0, 1}, from.yaw)};
  }
  return {};
}

// Behind furniture, or at the back of it, a thing may be near a way and yet never in sight.
std::string NavToObjTask::start_fault(const World& world) const {
  const std::string fault = ObjectTask::start_fault(world);
  if (!fault.empty() || !routes_) return fault;
  const Pose base = robot().base_pose(world), camera = inverse(base) * camera_pose(world);
  const Vec3 ahead = rotate(base.q, {1, 0, 0});
  const auto seen = [&](const BasePose& p) {
    const auto [index, distance] = nearest(world, p.x, p.y);
    const Pose there{{p.x, p.y, base.p.z}, axis_angle({0, 0, 1}, p.yaw)};
    return distance < kNearby && sees(world, there * camera, index);
  };
  const auto left = [&](double x, double y) {
    return std::max(0.0, nearest(world, x, y).second - kNearby);
  };
  if (!routes_->find({base.p.x, base.p.y, std::atan2(ahead.y, ahead.x)}, seen, left).empty())
    return "";
  return fmt::format(
      "task '{}': robot '{}' sees no {} in scene '{}' from anywhere that it can drive to", name(),
      robot().name(), object(world.id).name, scene().cfg().name);
}

std::pair<int, double> NavToObjTask::nearest(const World& world, double x, double y) const {
  std::pair<int, double> best{-1, 1e10};
  for (int i : candidates(world.id)) {
    const double* at = world.data->xpos + 3 * scene_object(i).body;
    const double d = std::hypot(at[0] - x, at[1] - y);
    if (d < best.second) best = {i, d};
  }
  return best;
}

bool NavToObjTask::sees(const World& world, const Pose& camera, int index) const {
  const auto with = [&](std::span<const Vec3> points) {
    return sight_.sees(world.model, world.data, camera, scene_object(index).body, points);
  };
  const double size = scene().size(world.id, index);
  if (size == 1) return with(points_[index]);
  std::vector<Vec3> points;
  for (Vec3 p : points_[index]) points.push_back(size * p);
  return with(points);
}

NavToObjTask::Judgement NavToObjTask::judgement(const World& world) const {
  const Vec3 base = robot().base_pose(world).p;
  const auto [index, distance] = nearest(world, base.x, base.y);
  Judgement out{distance, 0};
  if (distance < kReach && sees(world, camera_pose(world), index))
    out.reward = 1 - distance / kReach;
  return out;
}

Evaluation NavToObjTask::evaluate(const World& world) const {
  const Judgement now = judgement(world);
  return judge_by(world.id, now.reward,
                  now.reward > 0          ? ""
                  : now.distance < kReach ? "the camera does not see the object"
                                          : "the object is too far away");
}

std::string NavToObjTask::description(int world) const {
  const auto& candidates = candidates_[world];
  const std::string& text = object(world).name;
  if (candidates.size() == 1) return "Navigate to the " + text;
  return fmt::format("Navigate to any {} ({} available)", text, candidates.size());
}

Task::Referrals NavToObjTask::referrals(int world) const {
  return {{"object_name", referrals_of(scene_object(candidates(world)[0]))}};
}

void NavToObjTask::write_info(const World& world, JsonWriter& json) const {
  const Judgement now = judgement(world);
  json.key("position_error").value(now.distance);
  json.key("success").value(now.reward > 0);
}

std::vector<std::shared_ptr<Sensor>> NavToObjTask::create_task_sensors() const {
  std::vector<NamedBody> bodies;
  for (int i = 0; i < static_cast<int>(scene().objects().size()); ++i) {
    const int body = scene().objects()[i].body;
    bodies.push_back({mjsense::name_of(model(), mjOBJ_BODY, body), [this, i, body](int world) {
                        const auto& of = candidates_[world];
                        return std::ranges::find(of, i) != of.end() ? body : -1;
                      }});
  }
  return {body_poses_sensor(*this, "pickup_obj_pose", std::move(bodies))};
}

std::vector<std::pair<std::string, std::string>> NavToObjTask::scene_info(int world) const {
  return {{"text", description(world)}, {"object_name", object(world).name}};
}

}  // namespace mjsense
