// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/foreign_arrays.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <utility>

#include "mjsense/core/error.h"
#include "mjsense/scene/mujoco_log.h"
#include "mjsense/worlds/ordered_apply.h"
#include "mjsense/worlds/step_stages.h"

namespace mjsense::worlds {

ForeignArrays::ForeignArrays(const mjModel* model, int num_worlds, int threads)
    : worlds_(model, num_worlds, threads),
      data_(num_worlds),
      model_(worlds_,
             [this] {
               current_.assign(worlds_.size(), 0);
               worlds_.model_changed();
             }),
      contacts_(num_worlds),
      scratch_(worlds_.model()),
      borrowed_(num_worlds),
      current_(num_worlds),
      scratched_(num_worlds) {
  fill_scratch();
  set_option("opt.disableflags", {static_cast<double>(model->opt.disableflags)});
}

void ForeignArrays::set_option(const std::string& name, const std::vector<double>& values) {
  int size = 0, element = 0;
  current_.assign(worlds_.size(), 0);
  void* rows = mjb_expand(worlds_.batch(), name.c_str(), &size, &element);
  if (!rows || size != 1 || values.empty())
    throw ValueError(fmt::format("MuJoCo has no option {} with one number", name));
  for (int w = 0; w < worlds_.size(); ++w) {
    const double value = values[w % values.size()];
    if (element == sizeof(int))
      static_cast<int*>(rows)[w] =
          static_cast<int>(value) | (name == "opt.disableflags" ? mjDSBL_AUTORESET : 0);
    else
      static_cast<mjtNum*>(rows)[w] = value;
  }
}

void ForeignArrays::clear(int max_contacts, int max_constraints) {
  data_.clear(max_constraints);
  model_.clear();
  contacts_.clear(max_contacts);
}

// Makes an mjData for each thread, so that none is made while the worlds run.
void ForeignArrays::fill_scratch() {
  std::vector<ScratchData::Loan> all(worlds_.threads());
  for (ScratchData::Loan& one : all) one = scratch_.borrow();
}

// Calls function(m, d, world, this) for all worlds.
void ForeignArrays::apply(mjfBatchFunc function) {
  apply_ordered(worlds_.batch(), nullptr, 0, function, this, 1);
  scene::drop_warnings(false);  // an error leaves the flag set
  for (mjData*& data : borrowed_) {
    if (!data) continue;
    mj_deleteData(std::exchange(data, nullptr));
    fill_scratch();
  }
  for (int w = 0; w < worlds_.size(); ++w) {
    if (mjb_status(worlds_.batch())[w])
      throw RuntimeError(fmt::format("world {}: MuJoCo: {}", w, mjb_error(worlds_.batch(), w)));
  }
}

bool ForeignArrays::add_data(std::string_view field, const ArrayView& rows, bool input) {
  if (!data_.add(worlds_.model(), field, rows, input)) return false;
  if (field == "efc_id") contacts_.add_ids(rows);
  if (input) {
    apply([](const mjModel*, mjData* d, int w, void* argument) {
      static_cast<ForeignArrays*>(argument)->data_.see_initial(d, w);
    });
  }
  return true;
}

bool ForeignArrays::add_model(const std::string& field, const ArrayView& rows) {
  return model_.add(field, rows);
}

bool ForeignArrays::add_contacts(std::string_view field, const ArrayView& rows) {
  return contacts_.add(field, rows);
}

void ForeignArrays::take_poses() {
  model_.take();
  apply([](const mjModel*, mjData* d, int w, void* argument) {
    static_cast<const ForeignArrays*>(argument)->data_.take_shown(d, w, true);
  });
}

void ForeignArrays::show(const mjData* d, int w) {
  data_.show(d, w, call_);
  if (call_ != RawCall::kPositions) contacts_.copy(d, w);
}

// Uses an mjData that is shared by the thread's worlds and stays in its cache, as
// Worlds::step_in_scratch(). Poses that rays read are carried over, too.
void ForeignArrays::step_in_scratch(const mjModel* m, mjData* d, int w) {
  mjData* s = borrowed_[w] = scratch_.borrow().release();
  mj_copyState(m, d, s, mjSTATE_INTEGRATION);
  mj_step(m, s);
  mj_copyState(m, s, d, mjSTATE_INTEGRATION);
  mju_copy(d->geom_xpos, s->geom_xpos, 3 * static_cast<int>(m->ngeom));
  mju_copy(d->geom_xmat, s->geom_xmat, 9 * static_cast<int>(m->ngeom));
  show(s, w);
  scratched_[w] = 1;
  borrowed_[w] = nullptr;
  const ScratchData::Loan returned(s, ScratchData::Release{&scratch_});
  scene::drop_warnings(false);
  orders_before(this);
}

// Computes them in another mjData, which has the world's state only. Poses that rays read are carried
// over by take_poses().
void ForeignArrays::compute_positions(const mjModel* m, mjData* d, int w) {
  mjData* s = borrowed_[w] = scratch_.borrow().release();
  mj_copyState(m, d, s, mjSTATE_INTEGRATION);
  mj_fwdKinematics(m, s);
  mj_makeM(m, s);
  mj_factorM(m, s);
  mj_transmission(m, s);
  show(s, w);
  borrowed_[w] = nullptr;
  const ScratchData::Loan returned(s, ScratchData::Release{&scratch_});
}

// A world whose state is not finite: MuJoCo would find contacts between all its geoms. Its state stays,
// and its results are NaN.
void ForeignArrays::show_diverged(const mjModel* m, mjData* d, int w) {
  d->ncon = d->ne = d->nf = d->nl = d->nefc = 0;
  if (call_ == RawCall::kStep || call_ == RawCall::kStep2) d->time += m->opt.timestep;
  show(d, w);
  data_.show_diverged(w);
}

void ForeignArrays::run_world(const mjModel* m, mjData* d, int w, void* argument) {
  ordered_after(argument);
  auto& self = *static_cast<ForeignArrays*>(argument);
  if (self.call_ == RawCall::kReset && self.mask_ && !self.mask_[w]) return;
  scene::drop_warnings(true);
  const bool current = !self.data_.take(d, w) && self.current_[w];
  self.current_[w] = 0;  // also if a MuJoCo error jumps out of this function
  const auto is_bad = [](mjtNum x) { return mju_isBad(x) != 0; };
  if (self.call_ != RawCall::kReset && (std::any_of(d->qpos, d->qpos + m->nq, is_bad) ||
                                        std::any_of(d->qvel, d->qvel + m->nv, is_bad))) {
    self.show_diverged(m, d, w);
    scene::drop_warnings(false);
    return orders_before(argument);
  }
  switch (self.call_) {
    case RawCall::kStep:
      if (!can_split_step(m)) {
        mj_step(m, d);
      } else if (current) {
        step_from(mjSTAGE_VEL, m, d, true);
      } else {
        return self.step_in_scratch(m, d, w);
      }
      break;
    case RawCall::kForward:
      mj_forward(m, d);
      break;
    case RawCall::kStep1:
      self.data_.take_shown(d, w, false);
      mj_step1(m, d);
      break;
    case RawCall::kStep2:
      if (self.scratched_[w]) mj_step1(m, d);
      mj_step2(m, d);
      break;
    case RawCall::kReset:
      mj_resetData(m, d);
      break;
    case RawCall::kPositions:
      self.compute_positions(m, d, w);
      scene::drop_warnings(false);
      return orders_before(argument);
  }
  self.scratched_[w] = 0;
  self.current_[w] = self.call_ == RawCall::kForward || self.call_ == RawCall::kStep1;
  self.show(d, w);
  scene::drop_warnings(false);
  orders_before(argument);
}

void ForeignArrays::set_constants(std::span<const std::string> fields, bool restore) {
  model_.set_constants(fields);
  if (!restore) return;
  call_ = RawCall::kPositions;
  apply(run_world);
}

void ForeignArrays::run(RawCall call, const bool* mask) {
  model_.take();
  call_ = call;
  mask_ = mask;
  std::exception_ptr error;
  try {
    apply(run_world);
  } catch (const RuntimeError&) {
    error = std::current_exception();
  }
  if (contacts_.assign_rows()) {
    apply([](const mjModel* m, mjData*, int w, void* argument) {
      static_cast<ForeignArrays*>(argument)->contacts_.show(m, w);
    });
  }
  if (error) std::rethrow_exception(error);
  contacts_.check_capacity();
  data_.check_capacity();
}

}  // namespace mjsense::worlds
