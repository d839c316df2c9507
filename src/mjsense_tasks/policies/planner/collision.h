// SPDX-License-Identifier: Apache-2.0
#pragma once
// Collision checks of a robot in other configurations than its current one. Distances are MuJoCo's,
// between the colliding geoms of the scene's model, on scratch data; there is no second geometry.
// Pairs of the robot's own links are checked regardless of contype and conaffinity. Height fields
// and SDF geoms are ignored: MuJoCo has no distance function for them.

#include <span>
#include <utility>
#include <vector>

#include "mjsense/worlds/scratch_data.h"
#include "mjsense_tasks/robots/allowed_contact.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::policies {

// The pairs of geoms to check for a robot whose planned joints move, and scratch data for queries.
class CollisionModel {
 public:
  // `joints`: ids of hinges and slides; a configuration is their positions in this order. A free
  // joint cannot be one of them; CollisionQuery::place_base moves it.
  CollisionModel(const mjModel* model, const robots::Robot& robot, std::vector<int> joints);

  std::span<const int> joints() const { return joints_; }

 private:
  friend class CollisionQuery;

  const robots::Robot* robot_;
  std::vector<int> joints_;
  std::vector<int> moving_, scene_;        // geom ids
  std::vector<std::pair<int, int>> self_;  // link geoms that are not in contact at the start
  worlds::ScratchData scratch_;
};

// Queries about the current state of one world, for use by one thread.
class CollisionQuery {
 public:
  CollisionQuery(CollisionModel& model, const World& world);

  // Ignores this body and the bodies below it.
  void ignore(int body);
  // Ignores geoms whose top is below this height (m): the floor, for a mobile base.
  void ignore_below(double height);
  // Permits contact of the group `gripper` with `body` and the bodies below it, but not of the rest
  // of the robot.
  void allow(int gripper, int body);
  // Attaches `body` (which has a free joint) and the bodies below it to the leaf of `tool`, at
  // X_TO. They are checked like the robot; contact with the group `gripper` is permitted.
  void hold(int tool, int gripper, int body, const Pose& tool_object);
  // Opens the gripper, as at the start of an episode.
  void open(int gripper);
  // Moves a body with a free joint.
  void place(int body, const Pose& pose);
  void place_base(const Pose& base);                    // for a floating robot
  void set_margin(double margin) { margin_ = margin; }  // required clearance, m; initially 0

  bool free(std::span<const double> q);
  // True if the straight line between two configurations is free, both ends excluded.
  bool free_between(std::span<const double> from, std::span<const double> to);
  bool free_here();  // at the current placement
  // The two geoms of the last collision; -1 if there was none since forget_touching().
  std::pair<int, int> touching() const { return touching_; }
  void forget_touching() { touching_ = {-1, -1}; }

 private:
  void move_held();
  bool near_enough(int moving, int other) const;
  bool hit(int a, int b);

  CollisionModel& cm_;
  const mjModel* m_;
  worlds::ScratchData::Loan loan_;
  mjData* d_;
  double margin_ = 0;
  std::vector<int> scene_;  // geoms that are checked
  std::vector<robots::AllowedContact> allowed_;
  struct Held {
    int site = -1;
    robots::AllowedContact contact;
    Pose tool_object;
    std::vector<int> geoms;
    std::vector<Pose> object_geom;  // X_OG
  };
  std::vector<Held> held_;
  std::vector<double> between_;
  std::pair<int, int> touching_{-1, -1};
};

}  // namespace mjsense::tasks::policies
