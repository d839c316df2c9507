// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/scene/mujoco_log.h"
#include "mjsense/worlds/ordered_apply.h"
#include "mjsense/worlds/state_components.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {

void Worlds::count_warnings(const mjData* d, int w, const int* before) {
  for (int i = 0; i < mjNWARNING; ++i) {
    const int now = d->warning[i].number;
    const int more =
        now < before[i] ? now : now - before[i];  // MuJoCo's own reset starts counting at 0
    if (more == 0) continue;
    warning_counts_[w][i] += more;
    if (!reported_[i]) warned_ = true;
  }
}

// Reports the first warning of each kind through MuJoCo's handler.
void Worlds::report_warnings() {
  if (!warned_.exchange(false)) return;
  for (int i = 0; i < mjNWARNING; ++i) {
    for (int w = 0; w < num_worlds_ && !reported_[i]; ++w) {
      if (warning_counts_[w][i] == 0) continue;
      reported_[i] = true;
      mju_warning("%s (world %d, %.4f s; further warnings of this kind are only counted)",
                  mju_warningText(i, mjb_warning(batch_)[w * mjNWARNING + i].lastinfo), w, time(w));
    }
  }
}

// Returns the worlds that failed in this call and appends the reasons to failures_.
std::vector<int> Worlds::take_failures(Op op) {
  std::vector<int> failed;
  for (int w : ids_) {
    std::string why;
    if (mjb_status(batch_)[w]) {
      why = fmt::format("MuJoCo: {}", mjb_error(batch_, w));
    } else if (!diverged_[w]) {
      continue;
    } else if (const int warning = diverged_[w] - 1; warning == kBadState) {
      why = fmt::format("the state that was written contains NaN or infinity ({})",
                        bad_component(batch_, w));
    } else {
      const auto& stat = mjb_warning(batch_)[w * mjNWARNING + warning];
      why =
          fmt::format("MuJoCo: {} (at {:.4f} s)", mju_warningText(warning, stat.lastinfo), time(w));
    }
    if (op == Op::kVisit && mjb_status(batch_)[w]) {
      // A read has no state change to undo: the error is passed to the caller.
      exceptions_[w] = std::make_exception_ptr(RuntimeError(fmt::format("world {}: {}", w, why)));
    } else {
      failures_.push_back({w, std::move(why)});
    }
    diverged_[w] = 0;
    derived_[w] = {};
    failed.push_back(w);
  }
  return failed;
}

// Resets only these worlds, each with the keyframe of its last reset. Returns an error message if all
// worlds of the call fail even in the reset.
std::string Worlds::reset_failed(std::vector<int> failed, Call call) {
  std::ranges::stable_sort(failed, {}, [this](int w) { return reset_key_[w]; });
  call.op = Op::kReset;
  for (auto first = failed.begin(); first != failed.end();) {
    call.key = reset_key_[*first];
    const auto last =
        std::find_if(first, failed.end(), [&](int w) { return reset_key_[w] != call.key; });
    apply_ordered(batch_, &*first, static_cast<int>(last - first), run, &call, 1);
    scene::drop_warnings(false);
    for (; first != last; ++first) {
      if (!broken_[*first]) continue;
      Failure& failure = *std::ranges::find(failures_, *first, &Failure::world);
      failure.message =
          fmt::format("fails even after a reset: MuJoCo: {}", mjb_error(batch_, *first));
    }
  }
  for (int w : ids_) {
    if (!broken_[w]) return "";
  }
  return fmt::format("world {} {}", failures_[0].world, failures_[0].message);
}

}  // namespace mjsense::worlds
