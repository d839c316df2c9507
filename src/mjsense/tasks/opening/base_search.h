// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where a robot's base can stand to open or close something.

#include <map>
#include <mutex>
#include <vector>

#include "mjsense/tasks/opening/reach.h"

namespace mjsense {

struct BaseSearchCfg {
  int candidates = 80;  // places tried for a target
  int wanted = 6;       // places kept
  int grasps = 10;      // tried at each
  // m and rad, about a point before the handle.
  double nearest = 0.30, farthest = 0.90, aside = 0.55, turn = 0.35;
};

// Where a base can stand; `driving`: the arm alone does not do it from there.
struct BasePlaces {
  std::vector<Pose> at;  // X_WB
  bool driving = false;
};

class BaseSearch {
 public:
  // `empty`: a start without what differs from episode to episode; `usual`: where the base stands then.
  BaseSearch(const Robot& robot, const HandleReach& reach, HandleReach::Start empty,
             const Pose& usual, BaseSearchCfg cfg = {});

  // The start with the robot's base there, in its start configuration without noise.
  HandleReach::Start placed(const HandleReach::Start& start, const Pose& base) const;
  // Places from which `one` goes from `from` to `to` in the empty scene, at the height of the usual one,
  // which is tried first; those from which the base drives meanwhile where there are no others. Found
  // once for this articulation, then kept.
  BasePlaces places(const Articulation& one, double from, double to) const;

 private:
  Pose before(const Pose& body, const Articulation& one, double distance, double aside,
              double turn) const;
  std::vector<Pose> search(const Articulation& one, double from, double to, bool driving) const;

  const Robot& robot_;
  const HandleReach& reach_;
  HandleReach::Start empty_;
  Pose usual_;
  BaseSearchCfg cfg_;
  mutable std::mutex mutex_;
  mutable std::map<int, BasePlaces> known_;  // by joint
};

}  // namespace mjsense
