// SPDX-License-Identifier: Apache-2.0
#pragma once
// Owning pointers to MuJoCo's models and data.

#include <mujoco/mujoco.h>

#include <memory>

#include "mjsense/core/mujoco_call.h"

namespace mjsense {

struct MujocoDelete {
  void operator()(mjModel* model) const { mj_deleteModel(model); }
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using ModelPtr = std::unique_ptr<mjModel, MujocoDelete>;
using DataPtr = std::unique_ptr<mjData, MujocoDelete>;

// Throws RuntimeError if MuJoCo fails.
inline DataPtr make_data(const mjModel* model) { return DataPtr(call_mujoco(mj_makeData, model)); }

}  // namespace mjsense
