// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/picking.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "mjsense_tasks/policies/planner/phases.h"
#include "mjsense_tasks/policies/planner/rejections.h"

namespace mjsense::tasks::policies {
namespace {

using std::numbers::pi;

// m; the boxes of a tilted gripper reach this far below the gripper itself
constexpr double kBelow = 0.004;
// degrees, maximum yaw of the approach from the direction robot to object
constexpr double kSide = 100;
constexpr int kFewGrasps = 64;
// A hand is given up after this many grasps from which it does not reach the place.
constexpr int kMaxMisplaced = 24;
constexpr double kAtHome = 0.1;  // rad
// Distances for moving a tool away from an obstacle it touches.
constexpr double kBack = 0.06, kUp = 0.10;  // m

}  // namespace

struct Picking::Search {
  const World& world;
  const PlanRequest& request;
  const Follower& follower;
  const FailedGrasps& failed;
  int max_near, max_far;  // maximum number of grasps that are tried
};

Picking::Picking(const Manipulation& shared, const Placing* placing)
    : m_(shared), placing_(placing) {}

const Picking::Grasps& Picking::grasps(const episode::ObjectShape& shape, int hand) {
  Grasps* entry = nullptr;
  {
    const std::lock_guard lock(grasps_mutex_);
    entry = &grasps_[{&shape, hand}];
  }
  std::call_once(entry->once, [&] {
    entry->of_object = grasps_all_around(m_.gripper(hand), shape, &entry->checks);
  });
  return *entry;
}

std::optional<Picking::Grip> Picking::plan(const World& world, const PlanRequest& request,
                                           const Follower& follower, const FailedGrasps& failed,
                                           Plan& plan) {
  std::vector<int> order(m_.num_hands());
  std::iota(order.begin(), order.end(), 0);
  const Vec3 object = m_.object_pose(world).p;
  std::ranges::stable_sort(order, {}, [&](int h) {
    return norm(m_.robot().leaf_pose(world, m_.hand(h).hand().tool).p - object);
  });
  const Search search{
      world, request, follower, failed, m_.cfg().max_ik_candidates, m_.cfg().max_far_candidates};
  std::vector<std::string> rejections;  // of the hands, from their last search
  for (const bool to_place : {true, false}) {
    if (to_place && (order.size() < 2 || !placing_)) continue;
    rejections.clear();
    for (int hand : order) {
      if (const auto grip = plan_pick_with(search, hand, to_place, plan)) return grip;
      plan.segments.clear();
      const std::string of_hand =
          order.size() < 2 ? "" : m_.gripper_group(m_.hand(hand)).name + ", ";
      rejections.push_back(of_hand + plan.rejection);
    }
  }
  plan.rejection = fmt::format("{}", fmt::join(rejections, "; "));
  return {};
}

bool Picking::can(const World& world, const PlanRequest& request, const Follower& follower,
                  const FailedGrasps& failed) {
  const Search search{world, request, follower, failed, kFewGrasps, 0};
  for (int hand = 0; hand < m_.num_hands(); ++hand) {
    Plan unused;
    if (plan_pick_with(search, hand, false, unused)) return true;
  }
  return false;
}

Vec3 Picking::wanted_approach(const World& world, const PlanRequest& request,
                              const Pose& object) const {
  Rng draw = m_.rng(world, request, "planner/approach");
  const double tilt = m_.cfg().max_tilt * std::sqrt(draw.uniform()) * pi / 180;
  const Vec3 out = object.p - m_.robot().base_pose(world).p;
  const double turn = std::atan2(out.y, out.x) + draw.uniform(-kSide, kSide) * pi / 180;
  return {std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn), -std::cos(tilt)};
}

// Moves the hand out of contact; returns its pose afterwards.
HandPose Picking::draw_back(const World& world, HandPlanner& hand, CollisionQuery& query,
                            const HandPose& start, Plan& plan) const {
  if (hand.is_free(query, start)) return start;
  for (const Pose& away : {backed(start.tool, kBack), raised(start.tool, kUp)}) {
    HandPose end;
    if (!hand.reach(world, away, start, end) || !hand.is_free(query, end)) continue;
    hand.add_line(world, plan, kOpenGripper, start.tool, away, m_.cfg().fast);
    return end;
  }
  return start;
}

std::optional<Picking::Grip> Picking::plan_pick_with(const Search& search, int h, bool to_place,
                                                     Plan& plan) {
  const World& world = search.world;
  const ManipulationPlannerCfg& cfg = m_.cfg();
  HandPlanner& hand = m_.hand(h);
  const int gripper = hand.hand().gripper;
  const robots::MoveGroup& group = m_.gripper_group(hand);
  const Pose object = m_.object_pose(world);
  const HandPose now = hand.now(world, search.follower);

  CollisionQuery query(hand.collisions(), world);
  query.open(gripper);
  query.set_margin(kMargin);
  const bool is_open = m_.robot().is_open(world, gripper);
  plan.wait(kOpenGripper, is_open ? 0 : cfg.close_time).grip(gripper, group.open_command);
  const HandPose start = draw_back(world, hand, query, now, plan);
  Rng path_rng = m_.rng(world, search.request, "planner/way");
  // The tool frame is turned so that its y axis is the closing direction. First pass: solutions
  // near the current joints; second pass: farther away.
  const GripperShape& shape = m_.gripper(h);
  const Grasps& found = grasps(m_.target_shape(world.id), h);
  const std::vector<Grasp> ranked =
      rank_grasps(found.of_object, object, start.tool * Pose{{}, shape.turn},
                  wanted_approach(world, search.request, object));
  int num_paths = 0, misplaced = 0;
  std::vector<Rejection> rejections(ranked.size());
  const auto say_why = [&] {
    plan.rejection =
        ranked.empty() ? text_of(found.checks, shape) : text_of("grasps", rejections, world.model);
  };
  for (const auto& [iterations, maximum] :
       {std::pair(robots::Chain::kTracking, search.max_near), std::pair(400, search.max_far)}) {
    int tried = 0;
    for (std::size_t i = 0; i < ranked.size(); ++i) {
      const Grasp& grasp = ranked[i];
      Rejection& rejection = rejections[i];
      if (shape.lowest(grasp.pose) < m_.scene().support_height(world.id) - kBelow) {
        rejection = {"in the support"};
        continue;
      }
      if (++tried > maximum || num_paths == cfg.max_paths) break;
      const Pose tool = grasp.pose * Pose{{}, conjugate(shape.turn)};
      if (iterations == robots::Chain::kTracking && search.failed.has(inverse(object) * tool)) {
        rejection = {"failed before"};
        continue;
      }
      HandPose before, at;
      const Pose pregrasp = backed(tool, cfg.pregrasp);
      rejection = {"out of reach"};
      if (!(iterations == robots::Chain::kTracking &&
            hand.reach_along(world, pregrasp, start, before)) &&
          !hand.reach(world, pregrasp, start, before, iterations))
        continue;
      query.set_margin(kMargin);
      query.forget_touching();
      if (!hand.is_free(query, before)) {
        rejection = Rejection::collision(query.touching());
        continue;
      }
      query.set_margin(kGraspMargin);
      if (!hand.line_is_free(world, query, before, tool, at) || !hand.is_free(query, at)) {
        if (query.touching().first >= 0) rejection = Rejection::collision(query.touching());
        continue;
      }
      if (to_place && !placing_->reaches(world, hand, at)) {
        rejection = {"with the goal out of reach"};
        if (++misplaced == kMaxMisplaced) return say_why(), std::nullopt;
        continue;
      }
      Plan rest;
      hand.add_line(world, rest, kGrasp, before.tool, at.tool, cfg.slow, cfg.settle);
      hand.add_line(world, rest, kCloseGripper, at.tool, at.tool, cfg.slow, cfg.close_time)
          .grip(gripper, group.closed_command);
      rejection = {"without space to lift the object"};
      if (!lift(world, hand, at, rest)) continue;
      ++num_paths;
      rejection = {"without a collision-free path to them"};
      query.set_margin(kMargin);
      if (!hand.add_path(world, query, plan, kPregrasp, start, before, path_rng)) continue;
      std::ranges::move(rest.segments, std::back_inserter(plan.segments));
      plan.grasp = tool;
      return Grip{h, inverse(tool) * object, now.tool};
    }
  }
  say_why();
  return {};
}

void Picking::plan_return_home(const World& world, const PlanRequest& request,
                               const Follower& follower, const robots::RobotValues& home,
                               Plan& plan) const {
  Rng path_rng = m_.rng(world, request, "planner/home");
  for (int h = 0; h < m_.num_hands(); ++h) {
    HandPlanner& hand = m_.hand(h);
    if (hand.floats()) continue;
    const int arm = hand.hand().tool;
    const HandPose now = hand.now(world, follower);
    double away = 0;
    for (int i = 0; i < home[arm].size; ++i)
      away = std::max(away, std::abs(home[arm].values[i] - now.joints[arm].values[i]));
    if (away < kAtHome) continue;
    CollisionQuery query(hand.collisions(), world);
    query.open(hand.hand().gripper);
    query.set_margin(kMargin);
    const std::size_t before = plan.segments.size();
    const HandPose start = draw_back(world, hand, query, now, plan);
    HandPose there = now;
    there.joints[arm] = home[arm];
    if (!hand.is_free(query, there) ||
        !hand.add_path(world, query, plan, kOpenGripper, start, there, path_rng))
      plan.segments.resize(before);
  }
}

// Lifts the held object as far as there is room; otherwise moves back, opposite to the approach.
bool Picking::lift(const World& world, HandPlanner& hand, const HandPose& at, Plan& plan) const {
  const ManipulationPlannerCfg& cfg = m_.cfg();
  const int gripper = hand.hand().gripper, body = m_.target_body(world.id);
  CollisionQuery query(hand.collisions(), world);
  query.hold(hand.hand().tool, gripper, body, inverse(at.tool) * m_.object_pose(world));
  query.open(gripper);
  query.set_margin(kGraspMargin);
  const Pose up[] = {raised(at.tool, cfg.lift), raised(at.tool, 0.5 * cfg.lift),
                     raised(backed(at.tool, cfg.lift), 0.25 * cfg.lift)};
  for (const Pose& to : up) {
    HandPose end;
    if (!hand.line_is_free(world, query, at, to, end) || !hand.is_free(query, end)) continue;
    hand.add_line(world, plan, kLift, at.tool, to, cfg.slow).holds(gripper);
    return true;
  }
  return false;
}

}  // namespace mjsense::tasks::policies
