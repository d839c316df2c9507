// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/raycast/pose_history.h"

#include <algorithm>

namespace mjsense::sensors {

PoseHistory::PoseHistory(int count, int capacity)
    : capacity_(capacity),
      moments_(static_cast<std::size_t>(count) * capacity),
      newest_(count, 0),
      used_(count, 0) {}

void PoseHistory::clear(int frame) { used_[frame] = 0; }

const PoseHistory::Moment& PoseHistory::back(int frame, int age) const {
  return moments_[static_cast<std::size_t>(frame) * capacity_ +
                  (newest_[frame] - age + capacity_) % capacity_];
}

void PoseHistory::push(int frame, double time, const FramePose& pose) {
  // Times increase. A time that is equal or earlier means that the newest pose is measured again.
  while (used_[frame] > 0 && back(frame, 0).time >= time) {
    newest_[frame] = (newest_[frame] + capacity_ - 1) % capacity_;
    --used_[frame];
  }
  newest_[frame] = (newest_[frame] + 1) % capacity_;
  used_[frame] = std::min(used_[frame] + 1, capacity_);
  moments_[static_cast<std::size_t>(frame) * capacity_ + newest_[frame]] = {
      time, pose_from_mat(pose.pos, pose.mat)};
}

Pose PoseHistory::at(int frame, double time) const {
  if (time >= back(frame, 0).time) return back(frame, 0).pose;
  for (int age = 1; age < used_[frame]; ++age) {
    const Moment &before = back(frame, age), &after = back(frame, age - 1);
    if (time < before.time) continue;
    const double s = (time - before.time) / (after.time - before.time);
    const Quat turn = exp3(s * log3(conjugate(before.pose.q) * after.pose.q));
    return {before.pose.p + s * (after.pose.p - before.pose.p), normalized(before.pose.q * turn)};
  }
  return back(frame, used_[frame] - 1).pose;
}

}  // namespace mjsense::sensors
