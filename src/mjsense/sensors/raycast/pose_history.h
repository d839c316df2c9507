// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where frames were during the last moments: for rays that are cast at different times of one
// reading (a lidar's sweep).

#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/sensors/raycast/ray_frame.h"

namespace mjsense {

class PoseHistory {
 public:
  PoseHistory() = default;
  // Keeps `capacity` moments of each of `count` frames.
  PoseHistory(int count, int capacity);

  bool empty() const { return capacity_ == 0; }
  void clear(int frame);
  // A pose at `time` (s); one at the time of the newest replaces it.
  void push(int frame, double time, const FramePose& pose);
  // Interpolated (the turn along the shortest arc); before the first or after the last moment
  // known, that one.
  Pose at(int frame, double time) const;

 private:
  struct Moment {
    double time;
    Pose pose;
  };
  const Moment& back(int frame, int age) const;  // age 0: the newest

  int capacity_ = 0;
  std::vector<Moment> moments_;     // [count, capacity]
  std::vector<int> newest_, used_;  // [count]
};

}  // namespace mjsense
