// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/door/door_motion.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/observe/touches.h"
#include "mjsense_tasks/robots/allowed_contact.h"
#include "mjsense_tasks/scenes/robot_floor.h"

namespace mjsense::tasks::policies {
namespace {

constexpr int kReachIterations = 300;  // of inverse kinematics, for the first configuration
constexpr int kTries = 40;  // candidates of the next base pose that are checked for collisions
constexpr double kLeafHalf = 0.025;  // m, half the thickness of a leaf
constexpr double kMaxJump = 0.5;     // rad, of a joint between two waypoints
// Weights of the cost: joint motion, deviation from the posture at the grasp, closeness to a joint
// limit, translation and rotation of the base, closeness of the base to obstacles.
constexpr double kMove = 1.0, kPosture = 0.12, kLimit = 6.0, kDrive = 6.0, kTurn = 1.5,
                 kNear = 25.0;
constexpr double kNearLimit = 0.25, kComfort = 0.12;  // rad, m
constexpr double kReachCost = 0.15;                   // joint motion on the path to the handle
constexpr double kGood = 6;                        // the search stops at a motion with a lower cost
constexpr double kSwivel = 0.8, kMaxSwivel = 0.9;  // cost per rad^2; limit, rad

double distance_to_segment(double px, double py, Vec3 a, Vec3 b) {
  const double ex = b.x - a.x, ey = b.y - a.y, length = ex * ex + ey * ey;
  const double t =
      length > 0 ? std::clamp(((px - a.x) * ex + (py - a.y) * ey) / length, 0.0, 1.0) : 0.0;
  return std::hypot(px - a.x - t * ex, py - a.y - t * ey);
}

// Computes positions, then contacts. No object with a destructor may live in this frame: a MuJoCo
// error leaves it by longjmp.
void collide(const mjModel* m, mjData* d) {
  mj_kinematics(m, d);
  mj_comPos(m, d);
  mj_collision(m, d);
}

}  // namespace

// Plans for one hand, one grasp of the handle and one base pose at the grasp.
class DoorMotions::Attempt {
 public:
  Attempt(const DoorMotions& motions, const World& world, const scenes::Door& door,
          const DoorGeometry& geometry, robots::Hand hand, double margin, mjData* scratch)
      : motions_(motions),
        world_(world),
        door_(door),
        geometry_(geometry),
        hand_(hand),
        margin_(margin),
        scratch_(scratch),
        arm_(motions.robot_.groups()[hand.tool]),
        z_(motions.robot_.base_pose(world).p.z),
        closing_(closing_direction(world.data, motions.robot_.groups()[hand.gripper])) {
    motions_.robot_.read_qpos(world, start_);
    const auto& groups = motions_.robot_.cfg().groups;
    const auto& init = groups[hand.tool].init;
    for (std::size_t i = 0; i < init.size(); ++i) start_[hand.tool].values[i] = init[i];
  }

  // `swivel`: rotation of the hand about its closing direction, rad; a bar between flat pads
  // permits it.
  bool run(const Pose& straight, double swivel, const scenes::BasePose& base, double leaf,
           DoorMotion& out) {
    const Pose grasp = swivelled(straight, swivel);
    const DoorMotionCfg& cfg = motions_.cfg_;
    out = {};
    out.hand = hand_;
    out.grasp = grasp;
    const Pose before = moved(grasp, -cfg.before * rotate(grasp.q, {0, 0, 1}));
    robots::RobotValues values = start_;
    if (!solve(before, base, values, kReachIterations)) return false;
    reference_ = values;
    for (std::size_t i = 0; i < arm_.joints.size(); ++i) {
      const double travel = values[hand_.tool].values[i] - start_[hand_.tool].values[i];
      out.cost += kReachCost * travel * travel;
    }
    if (!follow_line(before, grasp, base, 0, 0, values, out.approach)) return false;
    if (limit_cost(values) > 0.6) return false;

    const int presses =
        geometry_.press == 0 ? 0 : 1 + static_cast<int>(std::abs(geometry_.press) / cfg.press_step);
    for (int i = 1; i <= presses; ++i) {
      const double lever = geometry_.press * i / presses;
      if (!step(geometry_.carried(grasp, lever, 0), base, 0, lever, values, out.press, out.cost))
        return false;
    }
    const int steps = 1 + static_cast<int>(std::abs(leaf) / cfg.leaf_step);
    scenes::BasePose at = base;
    swivel_ = swivel;
    for (int i = 1; i <= steps; ++i) {
      if (!open_step(straight, leaf * i / steps, leaf * (i - 1) / steps, at, values, out))
        return false;
    }
    // Straight away from the leaf at its final angle.
    const Pose last = swivelled(geometry_.carried(straight, geometry_.press, leaf), swivel_);
    const Pose off = moved(last, -0.08 * rotate(last.q, {0, 0, 1}));
    if (!follow_line(last, off, at, leaf, geometry_.press, values, out.leave)) out.leave.clear();
    return true;
  }

 private:
  static Pose moved(Pose pose, Vec3 by) {
    pose.p = pose.p + by;
    return pose;
  }

  Pose swivelled(const Pose& tool, double angle) const {
    return {tool.p, normalized(axis_angle(rotate(tool.q, closing_), angle) * tool.q)};
  }

  bool solve(const Pose& tool, const scenes::BasePose& base, robots::RobotValues& values,
             int iterations) const {
    return motions_.robot_.ik(hand_.tool, inverse(base.at_height(z_)) * tool, values, iterations);
  }

  double limit_cost(const robots::RobotValues& values) const {
    const mjModel* m = motions_.model_;
    double cost = 0;
    for (std::size_t i = 0; i < arm_.joints.size(); ++i) {
      const int j = arm_.joints[i];
      if (!m->jnt_limited[j]) continue;
      const double q = values[hand_.tool].values[i];
      const double room = std::min(q - m->jnt_range[2 * j], m->jnt_range[2 * j + 1] - q);
      const double lack = std::max(0.0, kNearLimit - room);
      cost += kLimit * lack * lack;
    }
    return cost;
  }

  double motion_cost(const robots::RobotValues& from, const robots::RobotValues& to) const {
    double cost = limit_cost(to);
    for (std::size_t i = 0; i < arm_.joints.size(); ++i) {
      const double q = to[hand_.tool].values[i];
      const double step = q - from[hand_.tool].values[i],
                   off = q - reference_[hand_.tool].values[i];
      if (std::abs(step) > kMaxJump) return 1e9;
      cost += kMove * step * step + kPosture * off * off;
    }
    return cost;
  }

  DoorWaypoint waypoint(const robots::RobotValues& values, const scenes::BasePose& base,
                        double leaf) const {
    const auto view = values[hand_.tool].values;
    return {
        {view.begin(), view.begin() + static_cast<std::ptrdiff_t>(arm_.joints.size())}, base, leaf};
  }

  bool follow_line(const Pose& from, const Pose& to, const scenes::BasePose& base, double leaf,
                   double lever, robots::RobotValues& values, std::vector<DoorWaypoint>& out) {
    const int steps = 4;
    for (int i = 0; i <= steps; ++i) {
      Pose tool = from;
      tool.p = from.p + (static_cast<double>(i) / steps) * (to.p - from.p);
      const robots::RobotValues before = values;
      if (!solve(tool, base, values, i == 0 ? kReachIterations : robots::Chain::kTracking))
        return false;
      if (i > 0 && motion_cost(before, values) > 1e8) return false;
      if (out.empty() && collides(values, base, leaf, lever)) return false;
      out.push_back(waypoint(values, base, leaf));
    }
    return true;
  }

  bool step(const Pose& tool, const scenes::BasePose& base, double leaf, double lever,
            robots::RobotValues& values, std::vector<DoorWaypoint>& out, double& cost) {
    const robots::RobotValues before = values;
    if (!solve(tool, base, values, robots::Chain::kTracking)) return false;
    const double c = motion_cost(before, values);
    if (c > 1e8 || collides(values, base, leaf, lever)) return false;
    cost += c;
    out.push_back(waypoint(values, base, leaf));
    return true;
  }

  // Opens the door by one step. Tries small motions of the base (with the door by 0, half or all of
  // its motion, sideways, rotated) and keeps the one with the lowest cost of the arm's motion.
  bool open_step(const Pose& grasp, double leaf, double last, scenes::BasePose& base,
                 robots::RobotValues& values, DoorMotion& out) {
    struct Choice {
      double cost, swivel;
      scenes::BasePose base;
      robots::RobotValues values;
    };
    const Pose straight = geometry_.carried(grasp, geometry_.press, leaf);
    // The base pose if the base were rigidly attached to the door.
    const Quat turn = axis_angle(geometry_.hinge_axis, leaf - last);
    const Vec3 carried =
        geometry_.hinge +
        rotate(turn, Vec3{base.x, base.y, 0} - Vec3{geometry_.hinge.x, geometry_.hinge.y, 0});
    const double yaw = geometry_.hinge_axis.z * (leaf - last);
    std::vector<Choice> choices;
    for (const double with : {0.0, 0.5, 1.0}) {
      for (const auto& [dx, dy] :
           {std::pair{0.0, 0.0}, {0.06, 0.0}, {-0.06, 0.0}, {0.0, 0.06}, {0.0, -0.06}}) {
        for (const double spin : {0.0, 0.05, -0.05}) {
          const scenes::BasePose b{base.x + with * (carried.x - base.x) + dx,
                                   base.y + with * (carried.y - base.y) + dy,
                                   base.yaw + with * yaw + spin};
          const double room = motions_.clearance(geometry_, b, leaf);
          if (room < margin_) continue;
          const double drive = std::hypot(b.x - base.x, b.y - base.y),
                       spun = scenes::wrapped(b.yaw - base.yaw);
          const double tight = std::max(0.0, kComfort - room);
          const double here = kDrive * drive * drive + kTurn * spun * spun + kNear * tight * tight;
          for (const double by : {0.0, 1.0, -1.0}) {
            const double swivel = swivel_ + by * std::abs(leaf - last);
            if (std::abs(swivel) > kMaxSwivel) continue;
            Choice choice{here + kSwivel * (swivel * swivel - swivel_ * swivel_), swivel, b,
                          values};
            if (!solve(swivelled(straight, swivel), b, choice.values, robots::Chain::kTracking / 4))
              continue;
            choice.cost += motion_cost(values, choice.values);
            if (choice.cost < 1e8) choices.push_back(choice);
          }
        }
      }
    }
    std::ranges::sort(choices, {}, &Choice::cost);
    for (std::size_t i = 0; i < choices.size() && i < kTries; ++i) {
      if (collides(choices[i].values, choices[i].base, leaf, geometry_.press)) continue;
      values = choices[i].values;
      base = choices[i].base;
      swivel_ = choices[i].swivel;
      out.cost += choices[i].cost;
      out.open.push_back(waypoint(values, base, leaf));
      return true;
    }
    return false;
  }

  // True if the robot is in collision with anything; contact of the gripper with the handle is
  // allowed.
  bool collides(const robots::RobotValues& values, const scenes::BasePose& base, double leaf,
                double lever) {
    const mjModel* m = world_.model;  // this world's model: furniture differs between worlds
    mjData* d = scratch_;
    mju_copy(d->qpos, world_.data->qpos, m->nq);
    const robots::MoveGroup& carrier = motions_.robot_.groups()[motions_.base_group_];
    const double place[3] = {base.x, base.y, base.yaw};
    for (int i = 0; i < 3; ++i) d->qpos[carrier.qpos[i]] = place[i];
    for (std::size_t i = 0; i < arm_.qpos.size(); ++i)
      d->qpos[arm_.qpos[i]] = values[hand_.tool].values[i];
    for (const robots::Hand& other : motions_.hands_) {
      if (other.tool == hand_.tool) continue;
      const robots::MoveGroup& arm = motions_.robot_.groups()[other.tool];
      const std::vector<double> q = motions_.tucked(other);
      for (std::size_t i = 0; i < q.size(); ++i) d->qpos[arm.qpos[i]] = q[i];
    }
    d->qpos[m->jnt_qposadr[door_.joint]] += leaf;
    if (door_.handle_joint >= 0) d->qpos[m->jnt_qposadr[door_.handle_joint]] += lever;
    collide(m, d);
    const robots::AllowedContact grasp{motions_.robot_.groups()[hand_.gripper].root_body,
                                       door_.handle};
    bool collides = false;
    observe::each_touch(m, d, m->body_rootid[motions_.robot_.base_body()],
                        [&](const observe::Touch& touch) {
                          collides = collides || (touch.contact->dist <= -motions_.cfg_.depth &&
                                                  !grasp.permits(m, touch.own, touch.other));
                        });
    return collides;
  }

  const DoorMotions& motions_;
  const World& world_;
  const scenes::Door& door_;
  const DoorGeometry& geometry_;
  robots::Hand hand_;
  double margin_;
  mjData* scratch_;
  const robots::MoveGroup& arm_;
  double z_;
  Vec3 closing_;       // closing direction, tool frame
  double swivel_ = 0;  // rad, current rotation of the hand about closing_
  robots::RobotValues start_, reference_;
};

DoorMotions::DoorMotions(const mjModel* model, const robots::Robot& robot, DoorFloor floor,
                         DoorMotionCfg cfg)
    : base_group_(scenes::driving_base(robot)),
      model_(model),
      robot_(robot),
      floor_(floor),
      cfg_(cfg),
      scratch_(model) {
  for (const robots::Hand& hand : robots::hands_of(robot, model)) {
    if (robot.groups()[hand.tool].kind == robots::GroupKind::kArm &&
        robot.groups()[hand.gripper].pad_sites[0] >= 0)
      hands_.push_back(hand);
  }
}

std::vector<double> DoorMotions::tucked(const robots::Hand& hand) const {
  std::vector<double> q;
  for (int joint : robot_.groups()[hand.tool].joints) {
    const double low = model_->jnt_range[2 * joint], high = model_->jnt_range[2 * joint + 1];
    q.push_back(model_->jnt_limited[joint] ? std::clamp(0.0, low + 0.05, high - 0.05) : 0.0);
  }
  return q;
}

double DoorMotions::clearance(const DoorGeometry& geometry, const scenes::BasePose& base,
                              double leaf) const {
  double minimum = floor_.footprint->clearance(*floor_.floor, base.x, base.y, base.yaw);
  const Vec3 edge = geometry.edge_at(leaf);
  const double c = std::cos(base.yaw), s = std::sin(base.yaw);
  for (const scenes::Disc& disc : floor_.footprint->discs()) {
    const double x = base.x + c * disc.x - s * disc.y, y = base.y + s * disc.x + c * disc.y;
    minimum = std::min(minimum,
                       distance_to_segment(x, y, geometry.hinge, edge) - kLeafHalf - disc.radius);
  }
  return minimum;
}

std::vector<scenes::BasePose> DoorMotions::places(const World& world,
                                                  const scenes::Door& door) const {
  const DoorGeometry geometry(model_, world.data, door, robot_.base_pose(world).p);
  const Vec3 handle = vec3(world.data->xpos + 3 * door.handle);
  const Vec3 hinge_side =
      normalized(Vec3{geometry.hinge.x - handle.x, geometry.hinge.y - handle.y, 0});
  // To push the door, the base drives through the doorway; to pull it, the base stays clear of the
  // leaf's path. Preferred offset towards the hinge, m.
  const double wanted =
      dot(geometry.away, scenes::opening_direction(model_, world.data, door)) < 0 ? 0.3 : -0.2;
  struct Place {
    scenes::BasePose base;
    double cost;
  };
  std::vector<Place> places;
  for (const double far : {0.62, 0.70, 0.78, 0.86}) {
    for (const double aside : {-0.45, -0.3, -0.15, 0.0, 0.15, 0.3, 0.45}) {
      for (const double turned : {0.0, 0.35, -0.35}) {
        const Vec3 p = handle + far * geometry.away + aside * hinge_side;
        const scenes::BasePose base{p.x, p.y,
                                    std::atan2(-geometry.away.y, -geometry.away.x) + turned};
        if (clearance(geometry, base, 0) < cfg_.margin) continue;
        places.push_back(
            {base, std::abs(far - 0.76) + 0.7 * std::abs(aside - wanted) + 0.3 * std::abs(turned)});
      }
    }
  }
  std::ranges::stable_sort(places, {}, &Place::cost);
  std::vector<scenes::BasePose> out;
  for (const Place& place : places) out.push_back(place.base);
  return out;
}

std::optional<DoorMotion> DoorMotions::plan(const World& world, const scenes::Door& door,
                                            const scenes::BasePose& base, double leaf,
                                            double margin, int tool) const {
  const worlds::ScratchData::Loan scratch = scratch_.borrow();
  worlds::copy_positions(model_, world.data, scratch.get());
  const DoorGeometry geometry(model_, world.data, door, robot_.base_pose(world).p);
  std::optional<DoorMotion> best;
  for (const robots::Hand& hand : hands_) {
    if (tool >= 0 && hand.tool != tool) continue;
    const Vec3 closing = closing_direction(world.data, robot_.groups()[hand.gripper]);
    const std::optional<HandleGrasps> grasps =
        handle_grasps(model_, world.data, door, geometry, closing);
    if (!grasps) continue;
    for (const Pose& grasp : grasps->poses) {
      Attempt attempt(*this, world, door, geometry, hand, margin, scratch.get());
      for (const double swivel : {0.0, 0.3, -0.3}) {
        if (best && best->cost < kGood) break;
        DoorMotion motion;
        if (attempt.run(grasp, swivel, base, leaf, motion) && (!best || motion.cost < best->cost))
          best = std::move(motion);
      }
    }
  }
  return best;
}

}  // namespace mjsense::tasks::policies
