// SPDX-License-Identifier: Apache-2.0
#include "mjsense/policies/planner/manipulation_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/policies/planner/phases.h"

namespace mjsense {
namespace {

using std::numbers::pi;

constexpr double kMargin = 0.004;        // m, of everything to everything on the way
constexpr double kGraspMargin = 0.001;   // m, of the open gripper at the grasp
constexpr double kBelow = 0.004;         // m that boxes around a slanting gripper reach below it
constexpr double kSide = 100;            // degrees, most that the approach turns from the way out
constexpr int kTurns = 16;               // about the vertical, of what is put down
constexpr int kMostGoals = 25 * kTurns;  // places and turns, before there is no way
constexpr double kSlipped = 0.05;        // m, object in the hand against where it was taken
constexpr double kSameGrasp = 0.012, kSameTurn = 0.4;  // m, rad: what failed is not tried again
// Of a tool that must get away from what it touches.
constexpr double kBack = 0.06, kUp = 0.10;  // m

Pose raised(Pose pose, double height) {
  pose.p.z += height;
  return pose;
}
Pose backed(const Pose& pose, double distance) { return pose * Pose{{0, 0, -distance}, {}}; }

}  // namespace

std::span<const Phase> ManipulationPlanner::phases() const { return kManipulationPhases; }

int ManipulationPlanner::first_phase() const { return kOpenGripper; }

void ManipulationPlanner::initialize_planner() {
  scene_ = task().grasp_scene();
  if (!scene_)
    throw ValueError(fmt::format("policy 'planner' picks; it cannot do task '{}'", task().name()));
  hands_.clear();
  grippers_.clear();
  for (const Hand& hand : hands_of(robot(), task().model())) {
    hands_.push_back(std::make_unique<HandPlanner>(task().model(), robot(), hand, cfg_.hand));
    grippers_.emplace_back(task().model(), robot(), hand.gripper);
  }
  if (hands_.empty())
    throw ValueError(fmt::format(
        "policy 'planner' needs an arm and a gripper; robot '{}' lacks one", robot().name()));
  grasps_.clear();
  for (std::size_t i = 0; i < scene_->all_objects().size() * hands_.size(); ++i)
    grasps_.push_back(std::make_unique<Grasps>());
  states_.assign(task().num_worlds(), {});
}

std::span<const Grasp> ManipulationPlanner::grasps(int object, int hand) {
  Grasps& entry = *grasps_[object * hands_.size() + hand];
  std::call_once(entry.once, [&] {
    entry.of_object = grasps_all_around(grippers_[hand], scene_->all_objects()[object].shape);
  });
  return entry.of_object;
}

Pose ManipulationPlanner::object_pose(const World& world) const {
  const int body = target_body(world.id);
  return {vec3(world.data->xpos + 3 * body), quat(world.data->xquat + 4 * body)};
}

// A function of the episode alone, whatever the world and what was planned before.
Rng ManipulationPlanner::rng(const World& world, const PlanRequest& request,
                             std::string_view what) const {
  return {task().cfg().seed, static_cast<std::uint32_t>(8 * request.attempt + request.stage),
          stream_of(what), static_cast<std::uint64_t>(task().episode(world.id))};
}

bool ManipulationPlanner::gone_wrong(const World& world) const {
  const State& state = states_[world.id];
  if (!state.holding) return false;
  const int phase = follower().phase(world.id);
  if (phase != kLift && phase != kPreplace && phase != kPlace) return false;
  // What has been let go may roll.
  const auto& segments = follower().plan(world.id).segments;
  const auto segment = static_cast<std::size_t>(follower().segment(world.id));
  if (segment >= segments.size() || segments[segment].holding.empty()) return false;
  const Hand& hand = hands_[state.hand]->hand();
  const Pose object = inverse(robot().leaf_pose(world, hand.tool)) * object_pose(world);
  return norm(object.p - state.tool_object.p) > kSlipped;
}

void ManipulationPlanner::make_plan(const World& world, const PlanRequest& request, Plan& plan) {
  State& state = states_[world.id];
  const bool places = scene_->place_scene() != nullptr;
  // After a failure the hands open and what they had comes to rest, before it is looked for.
  const int stage = request.attempt == 0 ? request.stage : request.stage - 1;
  if (stage < 0) {
    state.holding = false;
    state.failed.push_back(inverse(state.tool_object));
    let_go(plan);
  } else if (stage == 0) {
    state.holding = false;
    if (request.attempt == 0) {
      state.home = follower().joints(world.id);
      state.failed.clear();
    }
    plan_pick(world, request, plan);
    plan.more = !plan.segments.empty();
  } else if (stage == 1 && places) {
    plan_place(world, request, plan);
    plan.more = !plan.segments.empty();
  } else if (task().evaluate(world).success) {
    plan.wait(places ? kUnknownPhase : kLift, 0);
  }
}

void ManipulationPlanner::let_go(Plan& plan) const {
  Segment& open = plan.wait(kOpenGripper, cfg_.close_time);
  for (const auto& hand : hands_) {
    const int gripper = hand->hand().gripper;
    open.grip(gripper, robot().groups()[gripper].open_command);
  }
  plan.more = true;
}

void ManipulationPlanner::plan_pick(const World& world, const PlanRequest& request, Plan& plan) {
  std::vector<int> order(hands_.size());
  std::iota(order.begin(), order.end(), 0);
  const Vec3 object = object_pose(world).p;
  std::ranges::stable_sort(order, {}, [&](int h) {
    return norm(robot().leaf_pose(world, hands_[h]->hand().tool).p - object);
  });
  for (const bool to_place : {true, false}) {
    // Of several hands one that also gets to the place.
    if (to_place && (order.size() < 2 || !scene_->place_scene())) continue;
    for (int hand : order) {
      if (pick_with(world, request, hand, to_place, plan)) return;
      plan.segments.clear();
    }
  }
}

bool ManipulationPlanner::pick_with(const World& world, const PlanRequest& request, int h,
                                    bool to_place, Plan& plan) {
  HandPlanner& hand = *hands_[h];
  const int gripper = hand.hand().gripper;
  const MoveGroup& group = robot().groups()[gripper];
  const Pose object = object_pose(world);
  HandPose start = hand.now(world, follower());
  const Pose home = start.tool;

  // The approach that this episode asks for: anything from above to nearly level, out of the way of the robot.
  Rng draw = rng(world, request, "planner/approach");
  const double tilt = cfg_.most_tilt * std::sqrt(draw.uniform()) * pi / 180;
  const Vec3 out = object.p - robot().base_pose(world).p;
  const double turn = std::atan2(out.y, out.x) + draw.uniform(-kSide, kSide) * pi / 180;
  const Vec3 wanted{std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn),
                    -std::cos(tilt)};

  CollisionQuery query(hand.collisions(), world);
  query.open(gripper);
  query.set_margin(kMargin);
  const bool is_open = robot().is_open(world, gripper);
  plan.wait(kOpenGripper, is_open ? 0 : cfg_.close_time).grip(gripper, group.open_command);
  if (!hand.is_free(query, start)) {
    for (const Pose& away : {backed(start.tool, kBack), raised(start.tool, kUp)}) {
      HandPose end;
      if (!hand.reach(world, away, start, end) || !hand.is_free(query, end)) continue;
      hand.add_line(world, plan, kOpenGripper, start.tool, away, cfg_.fast);
      start = end;
      break;
    }
  }
  Rng way = rng(world, request, "planner/way");
  // The tool as a gripper whose y axis is the closing direction; near the present joints, then farther away.
  const GripperShape& shape = grippers_[h];
  const std::vector<Grasp> ranked = rank_grasps(grasps(scene_->target(world.id), h), object,
                                                start.tool * Pose{{}, shape.turn}, wanted);
  const auto has_failed = [&](const Pose& tool) {
    const Pose in_object = inverse(object) * tool;
    // With the fingers the other way round it is the same grasp.
    const Quat flipped = in_object.q * Quat{0, 0, 0, 1};
    return std::ranges::any_of(states_[world.id].failed, [&](const Pose& failed) {
      return norm(failed.p - in_object.p) < kSameGrasp &&
             std::min(angle_between(failed.q, in_object.q), angle_between(failed.q, flipped)) <
                 kSameTurn;
    });
  };
  int ways = 0;
  for (const auto& [iterations, most] : {std::pair(Chain::kTracking, cfg_.max_ik_candidates),
                                         std::pair(400, cfg_.max_far_candidates)}) {
    int tried = 0;
    for (const Grasp& grasp : ranked) {
      if (shape.lowest(grasp.pose) < scene_->support_height(world.id) - kBelow) continue;
      if (++tried > most || ways == cfg_.max_ways) break;
      const Pose tool = grasp.pose * Pose{{}, conjugate(shape.turn)};
      if (iterations == Chain::kTracking && has_failed(tool)) continue;  // rather another one
      HandPose before, at;
      const Pose pregrasp = backed(tool, cfg_.pregrasp);
      if (!(iterations == Chain::kTracking && hand.reach_along(world, pregrasp, start, before)) &&
          !hand.reach(world, pregrasp, start, before, iterations))
        continue;
      query.set_margin(kMargin);
      if (!hand.is_free(query, before)) continue;
      query.set_margin(kGraspMargin);
      if (!hand.line_is_free(world, query, before, tool, at) || !hand.is_free(query, at)) continue;
      if (to_place && !can_place(world, hand, at)) continue;
      Plan rest;
      hand.add_line(world, rest, kGrasp, before.tool, at.tool, cfg_.slow, cfg_.settle);
      hand.add_line(world, rest, kCloseGripper, at.tool, at.tool, cfg_.slow, cfg_.close_time)
          .grip(gripper, group.closed_command);
      if (!lift(world, hand, at, rest)) continue;
      ++ways;
      query.set_margin(kMargin);
      if (!hand.add_way(world, query, plan, kPregrasp, start, before, way)) continue;
      std::ranges::move(rest.segments, std::back_inserter(plan.segments));
      plan.grasp = tool;
      State& state = states_[world.id];
      state.hand = h;
      state.tool_object = inverse(tool) * object;
      if (request.attempt == 0) state.home_tool = home;
      return true;
    }
  }
  return false;
}

// Up with what is held, as far as there is room; else back, against the approach.
bool ManipulationPlanner::lift(const World& world, HandPlanner& hand, const HandPose& at,
                               Plan& plan) const {
  const int gripper = hand.hand().gripper, body = target_body(world.id);
  CollisionQuery query(hand.collisions(), world);
  query.hold(hand.hand().tool, gripper, body, inverse(at.tool) * object_pose(world));
  query.open(gripper);
  query.set_margin(kGraspMargin);
  const Pose up[] = {raised(at.tool, cfg_.lift), raised(at.tool, 0.5 * cfg_.lift),
                     raised(backed(at.tool, cfg_.lift), 0.25 * cfg_.lift)};
  for (const Pose& to : up) {
    HandPose end;
    if (!hand.line_is_free(world, query, at, to, end) || !hand.is_free(query, end)) continue;
    hand.add_line(world, plan, kLift, at.tool, to, cfg_.slow).holds(gripper);
    return true;
  }
  return false;
}

void ManipulationPlanner::plan_place(const World& world, const PlanRequest& request, Plan& plan) {
  State& state = states_[world.id];
  HandPlanner& hand = *hands_[state.hand];
  const Pose object = object_pose(world);
  const Pose tool_object = inverse(robot().leaf_pose(world, hand.hand().tool)) * object;
  if (norm(tool_object.p - state.tool_object.p) > kSlipped) return;
  state.tool_object = tool_object;
  state.holding = true;
  HandPose start = hand.now(world, follower());
  CollisionQuery query(hand.collisions(), world);
  query.hold(hand.hand().tool, hand.hand().gripper, target_body(world.id), tool_object);

  std::vector<Vec3> places;
  scene_->place_scene()->places(world, places);
  Rng draw = rng(world, request, "planner/place");
  int ways = 0;
  for (Vec3 place : places) {
    for (int k = 0; k < kTurns; ++k) {  // as it hangs, then turned to both sides, then between
      const Pose goal = placed(object, scene_->target(world.id), place, k);
      const std::size_t before = plan.segments.size();
      if (place_at(world, hand, query, start, goal, tool_object, draw, plan)) return;
      if (plan.segments.size() > before) plan.segments.resize(before);
      if (++ways > kMostGoals) return;
    }
  }
}

Pose ManipulationPlanner::placed(const Pose& object, int target, Vec3 place, int k) const {
  // The middle of its underside, from its origin, as it hangs.
  const ObjectShape& shape = scene_->all_objects()[target].shape;
  Vec3 low{1e9, 1e9, 1e9}, high{-1e9, -1e9, -1e9};
  for (Vec3 point : shape.points) {
    const Vec3 p = rotate(object.q, point);
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const Vec3 underside{0.5 * (low.x + high.x), 0.5 * (low.y + high.y), low.z};
  const int turns = (k % 2 ? -1 : 1) * ((k % 8 + 1) / 2);
  const Quat turn = axis_angle({0, 0, 1}, (turns + (k < 8 ? 0 : 0.5)) * 0.25 * pi);
  return {place + Vec3{0, 0, cfg_.clearance} - rotate(turn, underside), turn * object.q};
}

bool ManipulationPlanner::can_place(const World& world, const HandPlanner& hand,
                                    const HandPose& at) const {
  const Pose object = object_pose(world), object_tool = inverse(object) * at.tool;
  std::vector<Vec3> places;
  scene_->place_scene()->places(world, places);
  if (places.empty()) return true;
  for (int k = 0; k < kTurns; ++k) {
    const Pose tool = placed(object, scene_->target(world.id), places[0], k) * object_tool;
    HandPose above, there;
    if (hand.reach(world, raised(tool, cfg_.preplace), at, above) &&
        hand.reach(world, tool, above, there))
      return true;
  }
  return false;
}

bool ManipulationPlanner::place_at(const World& world, HandPlanner& hand, CollisionQuery& query,
                                   const HandPose& start, const Pose& object,
                                   const Pose& tool_object, Rng& rng, Plan& plan) {
  const int gripper = hand.hand().gripper, body = target_body(world.id);
  const Pose tool = object * inverse(tool_object), over = raised(tool, cfg_.preplace);
  HandPose above, at, away;
  query.set_margin(kGraspMargin);
  const auto fits = [&] {
    return hand.is_free(query, above) && hand.line_is_free(world, query, above, tool, at);
  };
  if (!(hand.reach_along(world, over, start, above) && fits()) &&
      !(hand.reach(world, over, start, above, 300) && fits()))
    return false;
  query.set_margin(0);
  if (!hand.is_free(query, at)) return false;

  CollisionQuery empty(hand.collisions(), world);
  empty.open(gripper);
  empty.place(body, object);
  empty.allow(gripper, body);
  bool gets_away = false;
  for (const Pose& to : {backed(tool, cfg_.retreat), raised(tool, cfg_.retreat)}) {
    gets_away = hand.line_is_free(world, empty, at, to, away) && hand.is_free(empty, away);
    if (gets_away) break;
  }
  if (!gets_away) return false;
  query.set_margin(kMargin);
  if (!hand.is_free(query, start) || !hand.is_free(query, above)) query.set_margin(0);
  if (!hand.add_way(world, query, plan, kPreplace, start, above, rng)) return false;
  for (Segment& segment : plan.segments) segment.holds(gripper);
  const MoveGroup& group = robot().groups()[gripper];
  hand.add_line(world, plan, kPlace, above.tool, tool, cfg_.slow, cfg_.place_settle).holds(gripper);
  hand.add_line(world, plan, kPlace, tool, tool, cfg_.slow, cfg_.open_time)
      .grip(gripper, group.open_command);
  hand.add_line(world, plan, kRetreat, tool, away.tool, cfg_.fast);
  go_home(world, hand, away, object, rng, plan);
  plan.wait(kUnknownPhase, cfg_.rest);
  return true;
}

// Where there is a free way: otherwise it stays.
void ManipulationPlanner::go_home(const World& world, HandPlanner& hand, const HandPose& from,
                                  const Pose& object, Rng& rng, Plan& plan) const {
  const State& state = states_[world.id];
  CollisionQuery query(hand.collisions(), world);
  query.open(hand.hand().gripper);
  query.place(target_body(world.id), object);
  HandPose home{state.home_tool, from.joints};
  home.joints[hand.hand().tool] = state.home[hand.hand().tool];
  if (!hand.is_free(query, home)) return;
  hand.add_way(world, query, plan, kGoHome, from, home, rng);
}

}  // namespace mjsense
