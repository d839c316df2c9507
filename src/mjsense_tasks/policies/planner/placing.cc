// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/placing.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numbers>

#include "mjsense/core/aabb.h"
#include "mjsense_tasks/policies/planner/phases.h"

namespace mjsense::tasks::policies {
namespace {

using std::numbers::pi;

constexpr int kTurns = 16;  // turns about the vertical that are tried
// maximum number of places and turns that are tried
constexpr std::size_t kMaxGoals = 25 * kTurns;
constexpr double kMaxLowered = 0.3;  // m, maximum height from which the object is put back

// The k-th turn: first none, then alternating to both sides, then the angles in between.
Quat turned(int k) {
  const int turns = (k % 2 ? -1 : 1) * ((k % 8 + 1) / 2);
  return axis_angle({0, 0, 1}, (turns + (k < 8 ? 0 : 0.5)) * 0.25 * pi);
}

}  // namespace

bool Placing::plan(const World& world, const PlanRequest& request, const Follower& follower,
                   HandPlanner& hand, const Pose& tool_object, const Home& home, Plan& plan) const {
  const Pose object = m_.object_pose(world);
  const HandPose start = hand.now(world, follower);
  CollisionQuery query(hand.collisions(), world);
  query.hold(hand.hand().tool, hand.hand().gripper, m_.target_body(world.id), tool_object);

  std::array<std::vector<Vec3>, kTurns> places;
  for (int k = 0; k < kTurns; ++k) m_.scene().place_scene()->places(world, turned(k), places[k]);
  Rng draw = m_.rng(world, request, "planner/place");
  std::vector<Rejection> rejections;
  std::size_t maximum = 0;
  for (const auto& of_turn : places) maximum = std::max(maximum, of_turn.size());
  for (std::size_t i = 0; i < maximum; ++i) {
    for (int k = 0; k < kTurns; ++k) {
      if (i >= places[k].size()) continue;
      const Pose goal = placed(object, m_.target_shape(world.id), places[k][i], k);
      const std::size_t before = plan.segments.size();
      Rejection& rejection = rejections.emplace_back();
      if (place_at(world, hand, query, start, goal, tool_object, home, draw, plan, rejection))
        return true;
      if (plan.segments.size() > before) plan.segments.resize(before);
      if (rejections.size() > kMaxGoals) break;
    }
    if (rejections.size() > kMaxGoals) break;
  }
  plan.rejection = text_of("poses of the object at its goal", rejections, world.model);
  return false;
}

double Placing::underside(const episode::ObjectShape& shape, const Quat& object) const {
  double low = std::numeric_limits<double>::infinity();
  for (Vec3 point : shape.points) low = std::min(low, rotate(object, point).z);
  return low;
}

Pose Placing::placed(const Pose& object, const episode::ObjectShape& shape, Vec3 place,
                     int k) const {
  // Middle of the underside relative to the origin, at its current orientation.
  Aabb box;
  for (Vec3 point : shape.points) box.add(rotate(object.q, point));
  const Vec3 underside{box.center().x, box.center().y, box.low.z};
  const Quat turn = turned(k);
  return {place + Vec3{0, 0, m_.cfg().clearance} - rotate(turn, underside), turn * object.q};
}

bool Placing::reaches(const World& world, const HandPlanner& hand, const HandPose& at) const {
  const Pose object = m_.object_pose(world), object_tool = inverse(object) * at.tool;
  std::vector<Vec3> places;
  for (int k = 0; k < kTurns; ++k) {
    places.clear();
    m_.scene().place_scene()->places(world, turned(k), places);
    if (places.empty()) continue;
    const Pose tool = placed(object, m_.target_shape(world.id), places[0], k) * object_tool;
    HandPose above, there;
    if (hand.reach(world, raised(tool, m_.cfg().preplace), at, above) &&
        hand.reach(world, tool, above, there))
      return true;
  }
  return false;
}

bool Placing::retreat_is_free(const World& world, HandPlanner& hand, const HandPose& at,
                              const Pose& object, HandPose& away) const {
  const int gripper = hand.hand().gripper, body = m_.target_body(world.id);
  CollisionQuery empty(hand.collisions(), world);
  empty.open(gripper);
  empty.place(body, object);
  empty.allow(gripper, body);
  if (!hand.is_free(empty, at)) return false;  // e.g. the fingers would open into a bowl's wall
  const double retreat = m_.cfg().retreat;
  for (const Pose& to : {backed(at.tool, retreat), raised(at.tool, retreat)}) {
    if (hand.line_is_free(world, empty, at, to, away) && hand.is_free(empty, away)) return true;
  }
  return false;
}

bool Placing::place_at(const World& world, HandPlanner& hand, CollisionQuery& query,
                       const HandPose& start, const Pose& object, const Pose& tool_object,
                       const Home& home, Rng& rng, Plan& plan, Rejection& rejection) const {
  const ManipulationPlannerCfg& cfg = m_.cfg();
  const int gripper = hand.hand().gripper;
  const Pose tool = object * inverse(tool_object), over = raised(tool, cfg.preplace);
  HandPose above, at, away;
  query.set_margin(kGraspMargin);
  const auto fits = [&] {
    return hand.is_free(query, above) && hand.line_is_free(world, query, above, tool, at);
  };
  query.forget_touching();
  if (!(hand.reach_along(world, over, start, above) && fits()) &&
      !(hand.reach(world, over, start, above, 300) && fits())) {
    rejection = {"out of reach"};
    if (query.touching().first >= 0) rejection = Rejection::collision(query.touching());
    return false;
  }
  query.set_margin(0);
  if (!hand.is_free(query, at)) {
    rejection = Rejection::collision(query.touching());
    return false;
  }
  rejection = {"without space for the fingers to open and retreat"};
  if (!retreat_is_free(world, hand, at, object, away)) return false;
  rejection = {"without a collision-free path to them"};
  query.set_margin(kMargin);
  if (!hand.is_free(query, start) || !hand.is_free(query, above)) query.set_margin(0);
  if (!hand.add_path(world, query, plan, kPreplace, start, above, rng)) return false;
  for (Segment& segment : plan.segments) segment.holds(gripper);
  const robots::MoveGroup& group = m_.gripper_group(hand);
  hand.add_line(world, plan, kPlace, above.tool, tool, cfg.slow, cfg.place_settle).holds(gripper);
  hand.add_line(world, plan, kPlace, tool, tool, cfg.slow, cfg.open_time)
      .grip(gripper, group.open_command);
  hand.add_line(world, plan, kRetreat, tool, away.tool, cfg.fast);
  plan_return_home(world, hand, away, object, home, rng, plan);
  plan.wait(kUnknownPhase, cfg.rest);
  return true;
}

bool Placing::put_back(const World& world, const Follower& follower, HandPlanner& hand,
                       const Pose& tool_object, Plan& plan) const {
  const ManipulationPlannerCfg& cfg = m_.cfg();
  const int gripper = hand.hand().gripper;
  const HandPose start = hand.now(world, follower);
  const Pose object = start.tool * tool_object;
  const double above = object.p.z + underside(m_.target_shape(world.id), object.q) -
                       m_.scene().support_height(world.id);
  if (above < cfg.clearance || above > kMaxLowered) return false;
  const double down = cfg.clearance - above;
  CollisionQuery query(hand.collisions(), world);
  query.hold(hand.hand().tool, gripper, m_.target_body(world.id), tool_object);
  HandPose at, away;
  if (!hand.line_is_free(world, query, start, raised(start.tool, down), at) ||
      !hand.is_free(query, at) || !retreat_is_free(world, hand, at, raised(object, down), away))
    return false;
  hand.add_line(world, plan, kPlace, start.tool, at.tool, cfg.slow, cfg.place_settle)
      .holds(gripper);
  hand.add_line(world, plan, kPlace, at.tool, at.tool, cfg.slow, cfg.open_time)
      .grip(gripper, m_.gripper_group(hand).open_command);
  hand.add_line(world, plan, kRetreat, at.tool, away.tool, cfg.fast);
  return true;
}

// The hand stays where it is if no collision-free path exists.
void Placing::plan_return_home(const World& world, HandPlanner& hand, const HandPose& from,
                               const Pose& object, const Home& home, Rng& rng, Plan& plan) const {
  CollisionQuery query(hand.collisions(), world);
  query.open(hand.hand().gripper);
  query.place(m_.target_body(world.id), object);
  // A floating hand uses the tool pose, an arm its joint positions.
  HandPose there{home.tool, from.joints};
  there.joints[hand.hand().tool] = home.joints[hand.hand().tool];
  query.set_margin(kMargin);
  if (!hand.is_free(query, from) || !hand.is_free(query, there)) query.set_margin(0);
  if (!hand.is_free(query, there)) return;
  hand.add_path(world, query, plan, kGoHome, from, there, rng);
}

}  // namespace mjsense::tasks::policies
