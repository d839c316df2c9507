// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <iterator>

#include "mjsense/worlds/state_components.h"
#include "mjsense/worlds/step_stages.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {
namespace {

// Warnings after which the state of a world is invalid. A bad control is one of them, because
// MuJoCo would silently replace it by zeros.
constexpr int kFatalWarnings[] = {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_BADCTRL};

// Copies the state and MuJoCo's counters.
void carry(const mjModel* m, const mjData* from, mjData* to) {
  mj_copyState(m, from, to, mjSTATE_INTEGRATION);
  std::copy_n(from->warning, mjNWARNING, to->warning);
  std::copy_n(from->timer, mjNTIMER, to->timer);
}

// MuJoCo warns about a bad control when it uses it. Forces computed with one must not be reused.
bool bad_control(const mjModel* m, const mjData* d) {
  return std::any_of(d->ctrl, d->ctrl + m->nu, [](mjtNum x) { return mju_isBad(x); });
}

}  // namespace

// Snapshot of a world's warning counts, used to detect new warnings.
class Worlds::Warnings {
 public:
  explicit Warnings(const mjData* d) : d_(d) {
    for (int i = 0; i < kNum; ++i) before_[i] = d->warning[kFatalWarnings[i]].number;
  }
  // The first fatal warning since then; -1 if there is none.
  int fatal() const {
    for (int i = 0; i < kNum; ++i) {
      if (d_->warning[kFatalWarnings[i]].number > before_[i]) return kFatalWarnings[i];
    }
    return -1;
  }

 private:
  static constexpr int kNum = std::size(kFatalWarnings);
  const mjData* d_;
  int before_[kNum];
};

World Worlds::view(const mjModel* m, mjData* d, int w) const {
  const Clock& c = clocks_[w];
  return {w, m, d, c.substep, c.tick, c.episode, seed_, c.substep == 0, c.key, c.moment};
}

bool Worlds::same_columns(int w, std::size_t begin, std::size_t end) const {
  const std::size_t row = w * num_state_;
  return std::memcmp(mjb_state(batch_) + row + begin, remembered_.data() + row + begin,
                     (end - begin) * sizeof(mjtNum)) == 0;
}

// True if neither the model nor any state that positions and velocities depend on was written.
bool Worlds::same_state(int w) const {
  return derived_[w].model_version == model_version_ && same_columns(w, 0, ctrl_begin_) &&
         same_columns(w, ctrl_end_, num_state_);
}

bool Worlds::same_controls(int w) const { return same_columns(w, ctrl_begin_, ctrl_end_); }

void Worlds::remember(const mjModel* m, const mjData* d, int w) {
  mj_getState(m, d, remembered_.data() + w * num_state_, mjSTATE_INTEGRATION);
  derived_[w].model_version = model_version_;
  derived_[w].behind = false;
}

// Computes derived fields, MuJoCo's sensors included, up to `stage`.
void Worlds::compute_stage(const mjModel* m, mjData* d, int w, mjtStage stage) {
  mjtStage& now = derived_[w].stage;
  if (stage == mjSTAGE_POS) stage = mjSTAGE_VEL;  // the next step needs both
  if (now < mjSTAGE_VEL && now < stage) {
    position_and_velocity(m, d, true);
    now = mjSTAGE_VEL;
  }
  if (now < mjSTAGE_ACC && now < stage) {
    mj_forwardSkip(m, d, mjSTAGE_VEL, 0);
    now = mjSTAGE_ACC;
  }
}

// The same, later than the step that reached the state. Controls written in the meantime take
// effect at the next step, so forces are still computed with the old controls.
void Worlds::compute_late_stage(const mjModel* m, mjData* d, int w, mjtStage stage) {
  if (derived_[w].stage >= stage) return;
  constexpr int kControls =
      mjSTATE_WARMSTART | mjSTATE_CTRL | mjSTATE_QFRC_APPLIED | mjSTATE_XFRC_APPLIED;
  const std::size_t controls = w * num_state_ + ctrl_begin_;
  const bool swap = stage == mjSTAGE_ACC && !same_controls(w);
  if (swap) mj_setState(m, d, remembered_.data() + controls, kControls);
  compute_stage(m, d, w, stage);
  if (swap) mj_setState(m, d, mjb_state(batch_) + controls, kControls);
}

void Worlds::keep_held(mjData* d, int w) const {
  for (const Held& held : held_[w]) {
    std::copy_n(held.pose, 7, d->qpos + held.qpos);
    std::fill_n(d->qvel + held.dof, 6, 0.0);
  }
}

bool Worlds::healthy(int w, const Warnings& warnings) {
  diverged_[w] = static_cast<std::uint8_t>(warnings.fatal() + 1);
  return diverged_[w] == 0;
}

// Advances one world by call.substeps and computes the stages that are read. Returns false if it
// diverged.
//
// Positions and velocities are computed once per state, whether a sensor or the next substep needs
// them first. The same holds for the constraint solve while the controls are unchanged: within a
// control step, and beyond its end if no new controls are written. A fresh force therefore costs at
// most one solve per control step.
bool Worlds::step_world(const mjModel* m, mjData* d, int w, const Call& call) {
  mjtStage& stage = derived_[w].stage;
  if (stage != mjSTAGE_NONE && (derived_[w].behind || !same_state(w))) stage = mjSTAGE_NONE;
  if (stage == mjSTAGE_ACC && (!same_controls(w) || bad_control(m, d))) stage = mjSTAGE_VEL;
  const bool seen = stage != mjSTAGE_NONE || call.hooks->wants_substep() ||
                    call.hooks->control_every() > 0 || call.hooks->stage() != mjSTAGE_NONE ||
                    !can_split_step(m);
  if (!(seen ? step_in_place(m, d, w, call) : step_in_scratch(m, d, w, call))) return false;
  remember(m, d, w);
  return true;
}

bool Worlds::step_in_place(const mjModel* m, mjData* d, int w, const Call& call) {
  const bool split = can_split_step(m);
  const bool every = call.hooks->wants_substep();
  const int control_every = call.hooks->control_every();
  const Warnings warnings(d);
  mjtStage& stage = derived_[w].stage;
  mj_checkPos(m, d);
  mj_checkVel(m, d);
  for (int k = 0; k < call.substeps; ++k) {
    if (!healthy(w, warnings)) return false;
    if (control_every > 0 && k % control_every == 0)
      stage = std::min(stage, call.hooks->control(view(m, d, w), k / control_every));
    const mjtStage from = stage;
    stage = mjSTAGE_NONE;  // also if a MuJoCo error jumps out of the step
    if (split) {
      step_from(from, m, d);
    } else {
      whole_step(m, d);
    }
    keep_held(d, w);
    mj_checkPos(m, d);
    mj_checkVel(m, d);
    if (!healthy(w, warnings)) return false;
    ++clocks_[w].substep;
    ++clocks_[w].tick;
    ++clocks_[w].moment;
    if (every) {
      compute_stage(m, d, w, call.hooks->substep_stage());
      call.hooks->substep(view(m, d, w));
    }
  }
  compute_stage(m, d, w, call.hooks->stage());
  return healthy(w, warnings);
}

// Steps a world that has no valid stages and whose derived fields are not read. It uses an mjData
// that is shared by the thread's worlds and stays in its cache. The mjData of many worlds, a
// hundred kilobytes each, would not, which costs a tenth of a step of a Go1 (bench/physics.py:
// MuJoCo's batch with and without `persistent`).
bool Worlds::step_in_scratch(const mjModel* m, mjData* d, int w, const Call& call) {
  const int substeps = call.substeps;
  ScratchSlot* bench = nullptr;
  for (ScratchSlot& each : scratch_slots_) {
    if (each.taken.exchange(true)) continue;
    bench = &each;
    break;
  }
  // A MuJoCo error in this call left one marked as taken.
  if (!bench) return step_in_place(m, d, w, call);
  mjData* s = bench->data;
  carry(m, d, s);
  const Warnings warnings(s);
  mj_checkPos(m, s);
  mj_checkVel(m, s);
  bool good = healthy(w, warnings);
  for (int k = 0; k < substeps && good; ++k) {
    step_from(mjSTAGE_NONE, m, s);
    keep_held(s, w);
    mj_checkPos(m, s);
    mj_checkVel(m, s);
    good = healthy(w, warnings);
  }
  carry(m, s, d);
  bench->taken = false;
  if (!good) return false;
  clocks_[w].substep += substeps;
  clocks_[w].tick += substeps;
  clocks_[w].moment += substeps;
  return true;
}

void Worlds::restart(const mjModel* m, mjData* d, int w, int key, WorldHooks& hooks) {
  broken_[w] = 1;  // stays if a MuJoCo error jumps out of this function
  if (key >= 0) {
    mj_resetDataKeyframe(m, d, key);
  } else if (key != kWrittenState) {
    mj_resetData(m, d);
  }
  held_[w].clear();
  derived_[w].stage = mjSTAGE_NONE;
  compute_stage(m, d, w, mjSTAGE_ACC);
  remember(m, d, w);
  reset_key_[w] = key;
  clocks_[w].substep = 0;
  ++clocks_[w].episode;
  ++clocks_[w].moment;
  broken_[w] = 0;
  hooks.reset(view(m, d, w));
}

void Worlds::follow_world(const mjModel* m, mjData* d, int w, const Call& call) {
  Clock& clock = clocks_[w];
  WorldHooks& hooks = *call.hooks;
  derived_[w].stage = mjSTAGE_NONE;
  clock.substep += call.substeps;
  clock.tick += call.substeps;
  ++clock.moment;
  if (hooks.wants_substep()) {
    compute_stage(m, d, w, hooks.substep_stage());
    World world = view(m, d, w);
    if (call.substeps > 1) world.elapsed = call.substeps * m->opt.timestep;
    hooks.substep(world);
  }
  compute_stage(m, d, w, hooks.stage());
  remember(m, d, w);
}

void Worlds::run_world(const mjModel* m, mjData* d, int w, const Call& call) {
  Derived& derived = derived_[w];
  if (broken_[w] && (call.op == Op::kStep || call.op == Op::kForward))
    restart(m, d, w, reset_key_[w], *call.hooks);
  if ((m->opt.enableflags & mjENBL_SLEEP) && derived.model_version != model_version_)
    all_poses(m, d);
  switch (call.op) {
    case Op::kStep:
      if (!step_world(m, d, w, call)) return;  // apply() resets the world
      // MuJoCo checks positions, velocities, accelerations and controls, but no mocap pose.
      if (!bad_component(batch_, w).empty()) {
        diverged_[w] = kBadState + 1;
        return;
      }
      break;
    case Op::kFollow:
      follow_world(m, d, w, call);
      break;
    case Op::kForward:
      if (!bad_component(batch_, w).empty()) {
        diverged_[w] = kBadState + 1;  // apply() resets the world
        return;
      }
      derived.stage = mjSTAGE_NONE;
      compute_stage(m, d, w, mjSTAGE_ACC);
      remember(m, d, w);
      ++clocks_[w].moment;
      break;
    case Op::kReset:
      restart(m, d, w, call.key, *call.hooks);
      break;
    case Op::kStepRaw:
      for (int k = 0; k < call.substeps; ++k) {
        mj_step(m, d);
        keep_held(d, w);
      }
      clocks_[w].substep += call.substeps;
      clocks_[w].tick += call.substeps;
      ++clocks_[w].moment;
      derived.behind = true;
      return;
    case Op::kVisit:
      if (broken_[w]) return;
      if (derived.behind) break;
      if (same_state(w)) {
        compute_late_stage(m, d, w, call.hooks->stage());
      } else {
        derived.stage = mjSTAGE_NONE;
        remember(m, d, w);
        ++clocks_[w].moment;
        compute_stage(m, d, w, call.hooks->stage());
      }
      break;
  }
  call.hooks->refreshed(view(m, d, w));
}

}  // namespace mjsense::worlds
