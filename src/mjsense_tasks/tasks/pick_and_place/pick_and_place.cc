// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/pick_and_place/pick_and_place.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense_tasks/scenes/object_references.h"
#include "mjsense_tasks/tasks/pick_and_place/places.h"
#include "mjsense_tasks/tasks/pick_and_place/placing_sentences.h"
#include "mjsense_tasks/tasks/pick_and_place/support_check.h"

namespace mjsense::tasks {
namespace {

using std::numbers::pi;

constexpr std::string_view kPlacingScene = "tableware";
constexpr double kPlacingGoal = 0.03;                // m, goal above the start
constexpr double kMoved = 0.1, kMovedBeside = 0.05;  // m, maximum displacement of the receptacle
constexpr double kTurned = 45 * pi / 180;            // rad, maximum tilt or rotation of it
constexpr double kBeside = 0.05 + 0.01;              // m, maximum horizontal gap
constexpr double kSamePlace = 0.005,
                 kSameTurn = 10 * pi / 180;  // m, rad, tolerance of a pose carried forward
constexpr double kSameHeight = 0.01;  // m, tolerance of underside heights without contact forces

// Name of receptacles that differ only in color, such as "bowl".
const std::string& noun(const scenes::SceneObject& object) {
  return object.others.empty() ? object.text : object.others[0];
}

}  // namespace

PickAndPlaceTask::PickAndPlaceTask(PlaceKind kind, episode::TaskCfg cfg)
    : scenes::SceneTask(std::move(cfg), kPlacingScene), kind_(kind) {}

std::string_view PickAndPlaceTask::name() const {
  switch (kind_) {
    case PlaceKind::kNextTo:
      return "pick_and_place_next_to";
    case PlaceKind::kColor:
      return "pick_and_place_color";
    case PlaceKind::kPacking:
      return "packing";
    default:
      return "pick_and_place";
  }
}

void PickAndPlaceTask::initialize_task() {
  scenes::SceneTask::initialize_task();
  const std::string context = this->context();
  if (scene().pickup_objects().empty())
    throw ValueError(
        fmt::format("{} has no object to pick up: no graspable body with a free joint", context));
  if (kind_ == PlaceKind::kNextTo) {
    if (scene().objects().size() < 2)
      throw ValueError(fmt::format("{} has only one object; at least two are needed", context));
  } else if (scene().receptacles().empty()) {
    throw ValueError(
        fmt::format("{} has no receptacle: none of its objects has receptacle = true", context));
  }
  objects_.clear();
  for (const scenes::SceneObject& object : scene().objects())
    objects_.push_back({object.body, object.kind, object.shape});
  if (kind_ == PlaceKind::kColor || kind_ == PlaceKind::kPacking) {
    Rng any(0, 0, 0, 0);
    if (choose(0, any).empty())
      throw ValueError(fmt::format(
          "{} {}", context,
          kind_ == PlaceKind::kColor
              ? "does not have two receptacles of the same kind (other_texts) with different colors"
              : "has no receptacle that is a box (text or other_texts)"));
  }
  episodes_.assign(num_worlds(), {});
  for (Episode& episode : episodes_) {
    episode.objects[0].role = kObject;
    episode.objects[1].role = kReceptacle;
    episode.supported.reserve(static_cast<std::size_t>(std::max(cfg().horizon, 0)) + 2);
  }
  standing_ = scenes::BasePlacementSearch(model(), robot(), scene());
  robot_root_ = model()->body_rootid[robot().base_body()];
}

// Indices of the object, its receptacle and other objects that must be present; empty if the scene
// does not have them.
std::vector<int> PickAndPlaceTask::choose(int world, Rng& rng) const {
  const auto any = [&](const std::vector<int>& of) {
    return of[rng.below(static_cast<std::uint32_t>(of.size()))];
  };
  const auto objects = scene().objects();
  const int target = scene().draw(world, scene().pickup_objects(), robot(), rng);
  std::vector<int> where;
  const auto rivals = [&](int r) {
    std::vector<int> found;
    for (int other : scene().receptacles()) {
      if (noun(objects[other]) == noun(objects[r]) && objects[other].color != objects[r].color)
        found.push_back(other);
    }
    return found;
  };
  if (kind_ == PlaceKind::kNextTo) {
    for (int i = 0; i < static_cast<int>(objects.size()); ++i) {
      if (i != target) where.push_back(i);
    }
  }
  for (int r : scene().receptacles()) {
    if (kind_ == PlaceKind::kInOrOn ||
        (kind_ == PlaceKind::kColor && !objects[r].color.empty() && !rivals(r).empty()) ||
        (kind_ == PlaceKind::kPacking && objects[r].kind.find("box") != std::string::npos))
      where.push_back(r);
  }
  if (where.empty()) return {};
  const int receptacle = any(where);
  std::vector<int> wanted{target, receptacle};
  if (kind_ == PlaceKind::kColor) wanted.push_back(any(rivals(receptacle)));
  return wanted;
}

std::optional<Pose> PickAndPlaceTask::sample_scene(int world, Rng& rng,
                                                   const robots::StateRow& state) {
  const auto number = static_cast<std::uint64_t>(this->episode(world));
  vary_scene(world);
  const std::vector<int> wanted = choose(world, rng);
  set_objects(world, wanted[0], wanted[1]);
  return standing_(scene().sample(world, wanted, cfg().seed, number, rng, state));
}

void PickAndPlaceTask::set_objects(int world, int target, int receptacle) {
  Episode& episode = episodes_[world];
  episode.target = target;
  episode.receptacle = receptacle;
  for (int k = 0; k < 2; ++k) {
    const scenes::SceneObject& object = scene().objects()[k == 0 ? target : receptacle];
    episode.objects[k].body = object.body;
    episode.objects[k].name = object.text;
  }
}

void PickAndPlaceTask::adopt(int world, const episode::GivenStart& start,
                             const robots::StateRow& state) {
  const std::vector<int> chosen =
      adopt_scene(world, start, std::array{kObject, kReceptacle}, state);
  set_objects(world, chosen[0], chosen[1]);
  scene().set_target(world, chosen[0], state);
}

void PickAndPlaceTask::begin(const World& world) {
  episode::Task::begin(world);
  Episode& episode = episodes_[world.id];
  episode.start = body_pose(world.data, episode.objects[0].body);
  episode.receptacle_start = body_pose(world.data, episode.objects[1].body);
  episode.supported.clear();
  episode.assessment = {};
}

const PickAndPlaceTask::Assessment& PickAndPlaceTask::assess(const World& world) const {
  Episode& episode = episodes_[world.id];
  Assessment& now = episode.assessment;
  if (now.step == episode_step(world.id)) return now;
  now = {};
  now.step = episode_step(world.id);
  const int object = episode.objects[0].body, receptacle = episode.objects[1].body;
  const Pose of_object = body_pose(world.data, object),
             of_receptacle = body_pose(world.data, receptacle);
  const Pose relative = inverse(of_receptacle) * of_object;
  now.supported = carries(world, receptacle, object);
  now.pos_diff = now.rot_diff = std::numeric_limits<double>::infinity();
  for (const Pose& earlier : episode.supported) {
    const double moved = norm(earlier.p - relative.p);
    const double turned = angle_between(earlier.q, relative.q);
    now.carried_forward = now.carried_forward || (moved <= kSamePlace && turned <= kSameTurn);
    if (moved >= now.pos_diff) continue;
    now.pos_diff = moved;
    now.rot_diff = turned;
  }
  if (now.supported && episode.supported.size() < episode.supported.capacity())
    episode.supported.push_back(relative);
  now.robot_contact = touched_by(world, object, robot_root_);
  now.position_error = norm(of_object.p - world_box(world, receptacle).center());
  const Pose displaced = inverse(episode.receptacle_start) * of_receptacle;
  now.moved = displaced.p;
  now.turned = angle_between({}, displaced.q);
  // Tilt is the angle between the vertical and the axis that was vertical at the start. A rotation
  // about this axis is not tilt.
  const Vec3 up = rotate(conjugate(episode.receptacle_start.q), {0, 0, 1});
  now.tilted = std::acos(std::clamp(rotate(of_receptacle.q, up).z, -1.0, 1.0));
  now.missing =
      kind_ == PlaceKind::kNextTo ? missing_beside(world, now) : missing_within(world.id, now);
  return now;
}

std::map<std::string, double> PickAndPlaceTask::thresholds() const {
  const bool beside = kind_ == PlaceKind::kNextTo;
  std::map<std::string, double> all{
      {"max_place_receptacle_pos_displacement", beside ? kMovedBeside : kMoved},
      {"max_place_receptacle_rot_displacement", kTurned}};
  if (beside) all["max_surface_to_surface_gap"] = kBeside;
  return all;
}

double PickAndPlaceTask::max_gap(int world) const {
  return threshold(world, "max_surface_to_surface_gap", kBeside);
}

double PickAndPlaceTask::max_moved(int world) const {
  return threshold(world, "max_place_receptacle_pos_displacement",
                   kind_ == PlaceKind::kNextTo ? kMovedBeside : kMoved);
}

double PickAndPlaceTask::max_turned(int world) const {
  return threshold(world, "max_place_receptacle_rot_displacement", kTurned);
}

std::string_view PickAndPlaceTask::missing_within(int world, const Assessment& now) const {
  if (!now.supported && !now.carried_forward) return "the receptacle does not carry the object";
  if (now.robot_contact) return "the robot touches the object";
  if (norm(now.moved) > max_moved(world)) return "the receptacle has moved";
  return now.tilted > max_turned(world) ? "the receptacle is tilted" : "";
}

std::string_view PickAndPlaceTask::missing_beside(const World& world, const Assessment& now) const {
  const Episode& episode = episodes_[world.id];
  const int object = episode.objects[0].body, other = episode.objects[1].body;
  const Aabb a = world_box(world, object), b = world_box(world, other);
  const double gap = gap_from_above(a, b);
  if (gap < 0 || gap > max_gap(world.id)) return "the object is not next to the other one";
  if (norm(now.moved) > max_moved(world.id) || now.turned > max_turned(world.id))
    return "the other object has moved";
  const int under = supporting_body(world, object), under_other = supporting_body(world, other);
  const bool together = under >= 0 && under_other >= 0 ? under == under_other
                                                       : std::abs(a.low.z - b.low.z) <= kSameHeight;
  return together ? "" : "the two objects are not on the same support";
}

std::string PickAndPlaceTask::start_error(const World& world) const {
  std::string fault = scenes::SceneTask::start_error(world);
  if (!fault.empty() || kind_ != PlaceKind::kNextTo) return fault;
  const auto& objects = episodes_[world.id].objects;
  const double gap =
      gap_from_above(world_box(world, objects[0].body), world_box(world, objects[1].body));
  if (gap < 0 || gap > max_gap(world.id)) return "";
  return fmt::format("{}: the {} is already next to the {}", context(), objects[0].name,
                     objects[1].name);
}

episode::Evaluation PickAndPlaceTask::evaluate(const World& world) const {
  const Assessment& now = assess(world);
  return make_evaluation_from(world.id, std::exp(-now.position_error), now.missing);
}

void PickAndPlaceTask::places(const World& world, const Quat& turn, std::vector<Vec3>& out) const {
  const Episode& episode = episodes_[world.id];
  // They depend on seed and episode only.
  const Rng rng(cfg().seed, 0, stream_of("task/place"),
                static_cast<std::uint64_t>(this->episode(world.id)));
  const PlaceQuery query{world, episode.objects[0].body, episode.objects[1].body, turn, rng};
  if (kind_ == PlaceKind::kNextTo) {
    places_beside(query, robot().base_body(), out);
  } else {
    places_within(query, shape(world.id, episode.receptacle).points, out);
  }
}

std::string PickAndPlaceTask::place_description(int world) const {
  const Episode& episode = episodes_[world];
  const scenes::SceneObject& object = scene().objects()[episode.receptacle];
  if (kind_ == PlaceKind::kColor) return object.color + " " + noun(object);
  return object.text;
}

std::string PickAndPlaceTask::description(int world) const {
  const std::string& name = episodes_[world].objects[0].name;
  const std::string where = place_description(world);
  switch (kind_) {
    case PlaceKind::kNextTo:
      return fmt::format("Pick up the {} and place it next to the {}", name, where);
    case PlaceKind::kPacking:
      return fmt::format("Pick up the {} and place it into the {}", name, where);
    default:
      return fmt::format("Pick up the {} and place it in or on the {}", name, where);
  }
}

std::string PickAndPlaceTask::paraphrase(const World& world, Rng& rng) const {
  const Episode& episode = episodes_[world.id];
  const Pose base = robot().base_pose(world);
  const std::array<int, 2> both{episode.target, episode.receptacle};
  const auto drawn = [&](int index) {
    // In "put the mug next to the plate" it must not be the mug that is next to the plate.
    const bool clauses = kind_ == PlaceKind::kNextTo;
    return scenes::draw_reference(
        scenes::object_references(world, scene(), index, base, both, false, clauses), rng);
  };
  const std::string object = drawn(both[0]);
  const std::string where =
      kind_ == PlaceKind::kColor ? "the " + place_description(world.id) : drawn(both[1]);
  if (object.empty() || where.empty()) return "";
  return placing_sentence(sentence_index(world.id, num_placing_sentences()), kind_, object, where,
                          scene().objects()[both[1]]);
}

episode::Task::Referrals::value_type PickAndPlaceTask::referral(const char* key, int index) const {
  const scenes::SceneObject& object = scene().objects()[index];
  std::vector<episode::Referral> texts{{object.text, object.others.empty() ? 1.0 : 0.5}};
  for (const std::string& other : object.others)
    texts.push_back({other, 0.5 / static_cast<double>(object.others.size())});
  return {key, std::move(texts)};
}

episode::Task::Referrals PickAndPlaceTask::referrals(int world) const {
  const Episode& episode = episodes_[world];
  Referrals all{referral("pickup_name", episode.target),
                referral("place_name", episode.receptacle)};
  // The color distinguishes the receptacle from others, so only the text with the color is valid.
  if (kind_ == PlaceKind::kColor) all[1].second = {{place_description(world), 1.0}};
  return all;
}

Pose PickAndPlaceTask::start_pose(int world, std::string_view role) const {
  if (role == kObject) return episodes_[world].start;
  if (role == kReceptacle) return episodes_[world].receptacle_start;
  const std::vector<std::string> roles{std::string(kObject), std::string(kReceptacle)};
  throw_unknown(fmt::format("task '{}'", name()), "role", role, roles);
}

std::optional<Pose> PickAndPlaceTask::goal_pose(int world, std::string_view role) const {
  Pose pose = start_pose(world, role);
  if (role == kReceptacle) return {};
  pose.p.z += kPlacingGoal;
  return pose;
}

void PickAndPlaceTask::write_info(const World& world, JsonWriter& json) const {
  const Assessment& now = assess(world);
  json.key("carry_forward_pos_diff").value(now.pos_diff);
  json.key("carry_forward_rot_diff").value(now.rot_diff);
  json.key("episode_step").value(episode_step(world.id));
  json.key("position_error").value(now.position_error);
  const double moved[3] = {now.moved.x, now.moved.y, now.moved.z};
  json.key("receptacle_pos_displacement").values(std::span<const double>(moved));
  json.key("receptacle_rot_displacement").value(now.turned);
  json.key("receptacle_tilt_displacement").value(now.tilted);
  json.key("robot_contact").value(now.robot_contact);
  json.key("success").value(now.missing.empty());
  json.key("supported_by_carry_forward").value(now.carried_forward);
  json.key("supported_by_receptacle").value(now.supported);
}

std::vector<std::pair<std::string, std::string>> PickAndPlaceTask::scene_info(int world) const {
  return {{"text", description(world)},
          {"object_name", episodes_[world].objects[0].name},
          {"place_receptacle_name", episodes_[world].objects[1].name}};
}

}  // namespace mjsense::tasks
