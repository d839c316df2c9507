// SPDX-License-Identifier: Apache-2.0
#pragma once
// Search for base placements from which a robot can open or close an articulation.

#include <map>
#include <mutex>
#include <vector>

#include "mjsense_tasks/tasks/opening/handle_reach.h"

namespace mjsense::tasks {

struct BaseSearchCfg {
  int candidates = 80;  // base placements tried for each target
  int wanted = 6;       // maximum number of base placements kept
  int grasps = 10;      // maximum number of grasps tried at each
  // m and rad: range of sampled base placements relative to a point in front of the handle.
  double nearest = 0.30, farthest = 0.90, aside = 0.55, turn = 0.35;
};

// Possible base placements. `driving`: the base must drive during the motion, because the arm alone
// cannot complete it.
struct BasePlaces {
  std::vector<Pose> at;  // X_WB
  bool driving = false;
};

class BaseSearch {
 public:
  // `empty`: a start without the objects that vary between episodes; `usual`: the base placement
  // there.
  BaseSearch(const robots::Robot& robot, const HandleReach& reach, HandleReach::Start empty,
             const Pose& usual, BaseSearchCfg cfg = {});

  // `start` with the robot's base at `base`, in the initial configuration without noise.
  HandleReach::Start placed(const HandleReach::Start& start, const Pose& base) const;
  // Base placements from which the robot can move `one` from `from` to `to` in the empty scene, at
  // the height of the usual placement, which is tried first. Placements that need a driving base
  // are returned only if there are no others. Results are cached per articulation. Thread-safe.
  BasePlaces places(const Articulation& one, double from, double to) const;

 private:
  Pose before(const Pose& body, const Articulation& one, double distance, double aside,
              double turn) const;
  std::vector<Pose> search(const Articulation& one, double from, double to, bool driving) const;

  const robots::Robot& robot_;
  const HandleReach& reach_;
  HandleReach::Start empty_;
  Pose usual_;
  BaseSearchCfg cfg_;
  mutable std::mutex mutex_;
  mutable std::map<int, BasePlaces> known_;  // by joint id
};

}  // namespace mjsense::tasks
