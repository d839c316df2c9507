// SPDX-License-Identifier: Apache-2.0
#pragma once
// Data of a model in which configurations are tried, beside those of the worlds.

#include <mujoco/mujoco.h>

#include <memory>
#include <mutex>
#include <vector>

namespace mjsense {

// Lends each to one caller at a time; safe for any thread. Made when first wanted, and kept for the next caller, who
// finds it as the last one left it. It outlives what it lends.
class ScratchData {
 public:
  struct GiveBack {
    ScratchData* to;
    void operator()(mjData* data) const { to->give_back(data); }
  };
  using Loan = std::unique_ptr<mjData, GiveBack>;

  explicit ScratchData(const mjModel* model) : model_(model) {}
  ~ScratchData();
  ScratchData(const ScratchData&) = delete;
  ScratchData& operator=(const ScratchData&) = delete;
  // Throws RuntimeError where there is no memory for it.
  Loan borrow();

 private:
  void give_back(mjData* data);

  const mjModel* model_;
  std::mutex mutex_;
  std::vector<mjData*> unused_;
};

}  // namespace mjsense
