// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <cmath>

#include "mjsense/core/row_error.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::tasks::rollout {
namespace {

// m/s or rad/s. MuJoCo's own limit is 1e10, which lets an object that a contact has thrown away fly
// on until the horizon.
constexpr double kMaxSpeed = 1e4;

}  // namespace

void Rollout::set_fault(int world, std::string text) {
  if (!active_[world] || !faults_[world].empty()) return;
  faults_[world] = std::move(text);
  evaluations_[world] = {};  // discard the evaluation of the previous step
}

void Rollout::take_failures() {
  for (const worlds::Failure& failure : simulation_->failures())
    set_fault(failure.world, failure.message);
}

// Ends the episodes in which something is faster than kMaxSpeed.
void Rollout::check_speeds(std::span<const int> worlds) {
  const mjModel* m = simulation_->model();
  for (int w : worlds) {
    for (int i = 0; i < m->nv; ++i) {
      const double speed = std::abs(rows_[w].qvel[i]);
      if (speed <= kMaxSpeed) continue;
      const int body = m->dof_bodyid[i];
      const char* name = mj_id2name(m, mjOBJ_BODY, body);
      set_fault(w, fmt::format("the physics diverged: body '{}' moves at {:.2g} m/s or rad/s, more "
                               "than {:.0e}",
                               name ? name : std::to_string(body), speed, kMaxSpeed));
      break;
    }
  }
}

// Runs `body`. If a row cannot be computed, only the episode of its world ends, and the result is
// false.
bool Rollout::guard_rows(const std::function<void()>& body) {
  try {
    body();
    return true;
  } catch (const RowError& e) {
    for (const RowError::Fault& fault : e.faults) {
      if (!active_[fault.world] || !faults_[fault.world].empty()) throw;
    }
    for (const RowError::Fault& fault : e.faults) {
      set_fault(fault.world, fault.text);
      refused_[fault.world] = true;
    }
    return false;
  }
}

// Runs `body` until all rows can be computed, or no episode is active: each failure ends the episodes
// of the worlds that it names, so that the next run computes fewer rows.
void Rollout::repeat_until_complete(const std::function<void()>& body) {
  bool complete = false;
  while (!complete && !active_worlds().empty()) complete = guard_rows(body);
}

}  // namespace mjsense::tasks::rollout
