// SPDX-License-Identifier: Apache-2.0
#pragma once
// mjb_apply with the ordering of its threads made visible to the thread sanitizer.

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace mjsense::worlds {

// MuJoCo's thread pool is not instrumented. These functions tell the thread sanitizer which
// accesses its atomics order. They do nothing in other builds.
inline void orders_before([[maybe_unused]] void* event) {
#ifdef __SANITIZE_THREAD__
  __tsan_release(event);
#endif
}
inline void ordered_after([[maybe_unused]] void* event) {
#ifdef __SANITIZE_THREAD__
  __tsan_acquire(event);
#endif
}

// Calls mjb_apply and makes its ordering visible to the thread sanitizer.
inline void apply_ordered(mjBatch* batch, const int* ids, int n, mjfBatchFunc run, void* call,
                          int save) {
  orders_before(call);
  mjb_apply(batch, ids, n, run, call, save);
  ordered_after(call);
}

}  // namespace mjsense::worlds
