// SPDX-License-Identifier: Apache-2.0
#pragma once
// Poses of frames at the last times, for rays that are cast at different times of one reading (a
// lidar's sweep).

#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/sensors/raycast/ray_frame.h"

namespace mjsense::sensors {

class PoseHistory {
 public:
  PoseHistory() = default;
  // Keeps `capacity` poses of each of `count` frames.
  PoseHistory(int count, int capacity);

  bool empty() const { return capacity_ == 0; }
  void clear(int frame);
  // Adds the pose at `time` (s). It replaces poses at the same time or later.
  void push(int frame, double time, const FramePose& pose);
  // Interpolated pose, with the rotation along the shortest arc. Before the first and after the
  // last known time it is the first or the last pose.
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

}  // namespace mjsense::sensors
