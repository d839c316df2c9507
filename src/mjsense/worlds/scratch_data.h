// SPDX-License-Identifier: Apache-2.0
#pragma once
// Pool of mjData in which configurations are evaluated without touching the worlds.

#include <mujoco/mujoco.h>

#include <memory>
#include <mutex>
#include <vector>

namespace mjsense::worlds {

// Lends each mjData to one caller at a time. Thread-safe. An mjData is created when needed and
// reused by later callers, who find it as the previous one left it. The pool must outlive all
// loans.
class ScratchData {
 public:
  struct Release {
    ScratchData* to;
    void operator()(mjData* data) const { to->release(data); }
  };
  using Loan = std::unique_ptr<mjData, Release>;

  explicit ScratchData(const mjModel* model) : model_(model) {}
  ~ScratchData();
  ScratchData(const ScratchData&) = delete;
  ScratchData& operator=(const ScratchData&) = delete;
  // Throws RuntimeError if the memory cannot be allocated.
  Loan borrow();

 private:
  void release(mjData* data);

  const mjModel* model_;
  std::mutex mutex_;
  std::vector<mjData*> unused_;
};

// Copies qpos and the poses of mocap bodies, from which MuJoCo computes all positions.
inline void copy_positions(const mjModel* model, const mjData* from, mjData* to) {
  mju_copy(to->qpos, from->qpos, model->nq);
  mju_copy(to->mocap_pos, from->mocap_pos, 3 * model->nmocap);
  mju_copy(to->mocap_quat, from->mocap_quat, 4 * model->nmocap);
}

}  // namespace mjsense::worlds
