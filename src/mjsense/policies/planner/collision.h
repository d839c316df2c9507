// SPDX-License-Identifier: Apache-2.0
#pragma once
// Does a robot, somewhere else than it stands, touch anything? Distances are MuJoCo's own, between
// the geoms that touch of the scene's model, on scratch data; there is no second geometry. Among
// themselves the robot's links are looked at whatever their contact bits say. Height fields and SDF
// geoms are not seen: MuJoCo has no distance to them.

#include <span>
#include <utility>
#include <vector>

#include "mjsense/robots/robot.h"
#include "mjsense/worlds/scratch_data.h"

namespace mjsense {

// Which pairs of geoms matter to a robot whose planned joints move, and scratch data for queries.
class CollisionModel {
 public:
  // `joints`: ids; configurations are their positions in this order. A free joint has none: it is
  // moved by CollisionQuery::place_base.
  CollisionModel(const mjModel* model, const Robot& robot, std::vector<int> joints);

  std::span<const int> joints() const { return joints_; }

 private:
  friend class CollisionQuery;

  const Robot* robot_;
  std::vector<int> joints_;
  std::vector<int> moving_, scene_;        // geoms
  std::vector<std::pair<int, int>> self_;  // of links that do not touch at the start
  ScratchData scratch_;
};

// Questions about one world as it stands now, for one thread.
class CollisionQuery {
 public:
  CollisionQuery(CollisionModel& model, const World& world);

  // Nothing that is below this body is looked at.
  void ignore(int body);
  // Nor what nowhere rises above this height (m): the floor, of a robot whose base drives.
  void ignore_below(double height);
  // The group `gripper` may touch what is below this body, the rest of the robot may not.
  void allow(int gripper, int body);
  // What is below this body - one with a free joint - moves with the leaf of `tool` at X_TO and is looked at with the
  // robot; the group `gripper` may touch it.
  void hold(int tool, int gripper, int body, const Pose& tool_object);
  // The gripper is open, as at the start of an episode.
  void open(int gripper);
  // A body with a free joint stands somewhere else.
  void place(int body, const Pose& pose);
  void place_base(const Pose& base);                    // of a floating robot
  void set_margin(double margin) { margin_ = margin; }  // m that must be free; 0 at the start

  bool free(std::span<const double> q);
  // Also between the two, both ends excluded.
  bool free_between(std::span<const double> from, std::span<const double> to);
  bool free_here();  // as it has been placed
  // The two geoms that touched when the last answer was no; -1 since forget_touching().
  std::pair<int, int> touching() const { return touching_; }
  void forget_touching() { touching_ = {-1, -1}; }

 private:
  void move_held();
  bool near_enough(int moving, int other) const;
  bool hit(int a, int b);
  bool is_robot_allowed(int geom, int other) const;

  CollisionModel& cm_;
  const mjModel* m_;
  ScratchData::Loan loan_;
  mjData* d_;
  double margin_ = 0;
  std::vector<int> scene_;  // geoms that are looked at
  std::vector<int> allowed_gripper_, allowed_body_;
  struct Held {
    int site = -1, gripper_body = -1, body = -1;
    Pose tool_object;
    std::vector<int> geoms;
    std::vector<Pose> object_geom;  // X_OG
  };
  std::vector<Held> held_;
  std::vector<double> between_;
  std::pair<int, int> touching_{-1, -1};
};

}  // namespace mjsense
