// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/scratch_data.h"

#include "mjsense/core/error.h"

namespace mjsense {

ScratchData::~ScratchData() {
  for (mjData* data : unused_) mj_deleteData(data);
}

ScratchData::Loan ScratchData::borrow() {
  {
    const std::lock_guard lock(mutex_);
    if (!unused_.empty()) {
      mjData* data = unused_.back();
      unused_.pop_back();
      return {data, GiveBack{this}};
    }
  }
  mjData* data = mj_makeData(model_);
  if (!data) throw RuntimeError("out of memory for the model's data");
  return {data, GiveBack{this}};
}

void ScratchData::give_back(mjData* data) {
  const std::lock_guard lock(mutex_);
  unused_.push_back(data);
}

}  // namespace mjsense
