// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/scratch_data.h"

#include "mjsense/core/mujoco_call.h"

namespace mjsense::worlds {

ScratchData::~ScratchData() {
  for (mjData* data : unused_) mj_deleteData(data);
}

ScratchData::Loan ScratchData::borrow() {
  {
    const std::lock_guard lock(mutex_);
    if (!unused_.empty()) {
      mjData* data = unused_.back();
      unused_.pop_back();
      return {data, Release{this}};
    }
  }
  return {call_mujoco(mj_makeData, model_), Release{this}};
}

void ScratchData::release(mjData* data) {
  const std::lock_guard lock(mutex_);
  unused_.push_back(data);
}

}  // namespace mjsense::worlds
