#include "mjsense/worlds/worlds.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/core/parallel.h"

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace mjsense {
namespace {

// MuJoCo's pool is not instrumented: these tell the thread sanitiser what its atomics order.
// Nothing in other builds.
void orders_before([[maybe_unused]] void* event) {
#ifdef __SANITIZE_THREAD__
  __tsan_release(event);
#endif
}
void ordered_after([[maybe_unused]] void* event) {
#ifdef __SANITIZE_THREAD__
  __tsan_acquire(event);
#endif
}

// One call of mjb_apply with that order made visible.
void apply_ordered(mjBatch* batch, const int* ids, int n, mjfBatchFunc run, void* call, int save) {
  orders_before(call);
  mjb_apply(batch, ids, n, run, call, save);
  ordered_after(call);
}

struct Component {
  std::string_view name;
  int bit;
  int width;  // columns of one element; 0: scalar elements, one column each
};
constexpr Component kComponents[] = {{"time", mjSTATE_TIME, 0},
                                     {"qpos", mjSTATE_QPOS, 0},
                                     {"qvel", mjSTATE_QVEL, 0},
                                     {"act", mjSTATE_ACT, 0},
                                     {"ctrl", mjSTATE_CTRL, 0},
                                     {"qfrc_applied", mjSTATE_QFRC_APPLIED, 0},
                                     {"xfrc_applied", mjSTATE_XFRC_APPLIED, 6},
                                     {"eq_active", mjSTATE_EQ_ACTIVE, 0},
                                     {"mocap_pos", mjSTATE_MOCAP_POS, 3},
                                     {"mocap_quat", mjSTATE_MOCAP_QUAT, 4},
                                     {"qacc_warmstart", mjSTATE_WARMSTART, 0},
                                     {"userdata", mjSTATE_USERDATA, 0}};

// Warnings after which the numbers of a world mean nothing. A bad control is one: MuJoCo would
// silently use zeros.
constexpr int kFatalWarnings[] = {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_BADCTRL};

// Whether mj_step may be taken apart into stages that are then reused. Otherwise: mj_step, then
// mj_forward.
bool can_split_step(const mjModel* m) {
  const bool single_step = m->opt.integrator == mjINT_EULER ||
                           m->opt.integrator == mjINT_IMPLICIT ||
                           m->opt.integrator == mjINT_IMPLICITFAST;
  const int whole = mjENBL_SLEEP | mjENBL_IPC | mjENBL_SPECULATIVE | mjENBL_FWDINV;
  const bool callbacks = mjcb_passive || mjcb_control || mjcb_contactfilter || mjcb_sensor ||
                         mjcb_act_dyn || mjcb_act_gain || mjcb_act_bias;
  return single_step && !(m->opt.enableflags & whole) && !callbacks && m->nhistory == 0 &&
         m->nplugin == 0;
}

void integrate(const mjModel* m, mjData* d) {
  mj_checkAcc(m, d);
  if (m->opt.integrator == mjINT_EULER) {
    mj_Euler(m, d);
  } else {
    mj_implicit(m, d);
  }
}

}  // namespace

Worlds::Worlds(const mjModel* model, int num_worlds, int threads) : num_worlds_(num_worlds) {
  if (num_worlds < 1)
    throw ValueError(fmt::format("num_worlds is {}: must be at least 1", num_worlds));
  if (threads < 0) throw ValueError(fmt::format("threads is {}: must be 0 (all) or more", threads));
  mjBatchConfig config;
  mjb_defaultConfig(&config);
  config.nthread = threads > 0 ? threads : available_cpus();
  config.persistent = 1;
  char error[1024] = "";
  batch_ = mjb_makeBatch(model, num_worlds, &config, error, sizeof error);
  if (!batch_) throw RuntimeError(fmt::format("cannot make {} worlds: {}", num_worlds, error));
  num_state_ = static_cast<std::size_t>(mjb_nstate(batch_));
  clocks_.resize(num_worlds);
  seed(0);
  reset_key_.assign(num_worlds, -1);
  remembered_.resize(num_worlds * num_state_);
  derived_version_.assign(num_worlds, -1);
  exceptions_.resize(num_worlds);
  diverged_.assign(num_worlds, 0);
  ids_.reserve(num_worlds);
  failures_.reserve(num_worlds);
  int size = 0;
  const mjtNum* row = mjb_state(batch_);
  ctrl_begin_ = mjb_stateComponent(batch_, mjSTATE_WARMSTART, &size) - row;
  ctrl_end_ = mjb_stateComponent(batch_, mjSTATE_XFRC_APPLIED, &size) - row;
  ctrl_end_ += size;
}

Worlds::~Worlds() { mjb_deleteBatch(batch_); }

int Worlds::threads() const { return mjb_nthread(batch_); }
const mjModel* Worlds::model() const { return mjb_model(batch_); }

void Worlds::seed(std::uint64_t seed) {
  seed_ = seed;
  for (int w = 0; w < num_worlds_; ++w) rekey(w, static_cast<std::uint32_t>(w));
}

void Worlds::rekey(int world, std::uint32_t key) {
  Clock& clock = clocks_[world];
  clock.tick = clock.episode = 0;
  clock.key = key;
}

double Worlds::time(int world) const {
  return static_cast<double>(clocks_[world].substep) * model()->opt.timestep;
}

std::vector<int> Worlds::checked_ids(WorldIds ids) const {
  std::vector<int> sorted;
  checked_ids(ids, sorted);
  return sorted;
}

void Worlds::checked_ids(WorldIds ids, std::vector<int>& sorted) const {
  if (ids.all()) {
    sorted.resize(num_worlds_);
    std::iota(sorted.begin(), sorted.end(), 0);
    return;
  }
  sorted.assign(ids.list().begin(), ids.list().end());
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    if (sorted[i] < 0 || sorted[i] >= num_worlds_) {
      throw ValueError(fmt::format("world id {}: must be in [0, {})", sorted[i], num_worlds_));
    }
    if (i > 0 && sorted[i] == sorted[i - 1])
      throw ValueError(fmt::format("world id {} is given twice", sorted[i]));
  }
}

ArrayView Worlds::state() {
  return ArrayView::dense(mjb_state(batch_), DType::kFloat64,
                          {num_worlds_, static_cast<std::int64_t>(num_state_)});
}

ArrayView Worlds::state_component(std::string_view name) {
  std::vector<std::string> names;
  for (const Component& c : kComponents) {
    names.emplace_back(c.name);
    if (c.name != name) continue;
    int size = 0;
    mjtNum* data = mjb_stateComponent(batch_, c.bit, &size);
    ArrayView v = c.width > 0 ? ArrayView::dense(data, DType::kFloat64,
                                                 {num_worlds_, size / c.width, c.width})
                              : ArrayView::dense(data, DType::kFloat64, {num_worlds_, size});
    v.strides[0] = static_cast<std::int64_t>(num_state_ * sizeof(mjtNum));
    return v;
  }
  throw_unknown("simulation", "state component", name, names);
}

void Worlds::step(int substeps, WorldHooks& hooks, WorldIds ids) {
  if (substeps < 1) throw ValueError(fmt::format("substeps is {}: must be at least 1", substeps));
  apply(ids, {this, Op::kStep, substeps, -1, &hooks}, true);
}

void Worlds::forward(WorldIds ids, WorldHooks& hooks) {
  apply(ids, {this, Op::kForward, 0, -1, &hooks}, true);
}

void Worlds::reset(WorldIds ids, int key, WorldHooks& hooks) {
  if (key < -1 || key >= model()->nkey) {
    throw ValueError(
        fmt::format("keyframe {}: the model has {} (-1: its defaults)", key, model()->nkey));
  }
  apply(ids, {this, Op::kReset, 0, key, &hooks}, true);
}

void Worlds::step_raw(int substeps) {
  if (substeps < 1) throw ValueError(fmt::format("substeps is {}: must be at least 1", substeps));
  apply(all_worlds, {this, Op::kStepRaw, substeps, -1, nullptr}, true);
}

void Worlds::visit(WorldIds ids, WorldHooks& hooks) {
  apply(ids, {this, Op::kVisit, 0, -1, &hooks}, false);
}

World Worlds::view(const mjModel* m, mjData* d, int w) const {
  const Clock& c = clocks_[w];
  return {w, m, d, c.substep, c.tick, c.episode, seed_, c.substep == 0, c.key, c.moment};
}

// True if the position and velocity stages in mjData belong to the state row as it is now.
bool Worlds::derived_current(int w) const {
  if (derived_version_[w] != model_version_) return false;
  const mjtNum* now = mjb_state(batch_) + w * num_state_;
  const mjtNum* then = remembered_.data() + w * num_state_;
  return std::memcmp(now, then, ctrl_begin_ * sizeof(mjtNum)) == 0 &&
         std::memcmp(now + ctrl_end_, then + ctrl_end_,
                     (num_state_ - ctrl_end_) * sizeof(mjtNum)) == 0;
}

// Advances one world by call.substeps and leaves it fresh. False if it diverged.
//
// The loop is mj_step taken apart so that each stage is computed once per state: the stages after a
// substep are the ones the next substep starts from. Where a sensor wants every substep, the solve
// made for it is reused too, because controls are constant within a control step; so a fresh
// measurement costs one extra solve per control step, not one per substep.
bool Worlds::step_world(const mjModel* m, mjData* d, int w, const Call& call) {
  const bool split = can_split_step(m);
  const bool every = call.hooks->wants_substep();
  int before[mjNWARNING];
  for (int i = 0; i < mjNWARNING; ++i) before[i] = d->warning[i].number;
  bool solved = false;
  if (split && !derived_current(w)) mj_step1(m, d);
  for (int k = 0; k < call.substeps; ++k) {
    const bool last = k + 1 == call.substeps;
    if (!split) {
      mj_step(m, d);
      if (every || last) mj_forward(m, d);
    } else {
      if (solved) {
        integrate(m, d);
      } else {
        mj_step2(m, d);
      }
      mj_step1(m, d);
      solved = every || last;
      if (solved) mj_forwardSkip(m, d, mjSTAGE_VEL, 0);
    }
    for (int fatal : kFatalWarnings) {
      if (d->warning[fatal].number > before[fatal]) {
        diverged_[w] = static_cast<std::uint8_t>(fatal + 1);
        return false;
      }
    }
    ++clocks_[w].substep;
    ++clocks_[w].tick;
    ++clocks_[w].moment;
    if (every) call.hooks->substep(view(m, d, w));
  }
  return true;
}

void Worlds::run_world(const mjModel* m, mjData* d, int w, const Call& call) {
  switch (call.op) {
    case Op::kStep:
      if (!step_world(m, d, w, call)) return;  // apply() resets it
      break;
    case Op::kForward:
      mj_forward(m, d);
      ++clocks_[w].moment;
      break;
    case Op::kReset:
      if (call.key >= 0) {
        mj_resetDataKeyframe(m, d, call.key);
      } else {
        mj_resetData(m, d);
      }
      mj_forward(m, d);
      reset_key_[w] = call.key;
      clocks_[w].substep = 0;
      ++clocks_[w].episode;
      ++clocks_[w].moment;
      break;
    case Op::kStepRaw:
      for (int k = 0; k < call.substeps; ++k) mj_step(m, d);
      clocks_[w].substep += call.substeps;
      clocks_[w].tick += call.substeps;
      ++clocks_[w].moment;
      mj_getState(m, d, remembered_.data() + w * num_state_, mjSTATE_INTEGRATION);
      derived_version_[w] = -1;
      return;
    case Op::kVisit:
      if (derived_version_[w] >= 0 && !derived_current(w)) {
        mj_forward(m, d);
        ++clocks_[w].moment;
      }
      break;
  }
  if (call.op != Op::kVisit || derived_version_[w] >= 0) {
    mj_getState(m, d, remembered_.data() + w * num_state_, mjSTATE_INTEGRATION);
    derived_version_[w] = model_version_;
  }
  if (call.op == Op::kReset) call.hooks->reset(view(m, d, w));
  call.hooks->refreshed(view(m, d, w));
}

// On one of MuJoCo's threads. A MuJoCo error jumps over this frame: it holds nothing to destroy.
void Worlds::run(const mjModel* m, mjData* d, int w, void* arg) {
  ordered_after(arg);
  const Call& call = *static_cast<const Call*>(arg);
  try {
    call.self->run_world(m, d, w, call);
  } catch (...) {
    call.self->exceptions_[w] = std::current_exception();
  }
  orders_before(arg);
}

void Worlds::apply(WorldIds ids, Call call, bool save) {
  checked_ids(ids, ids_);
  if (call.op != Op::kVisit) failures_.clear();
  if (ids_.empty()) return;  // MuJoCo would take it for all
  apply_ordered(batch_, ids_.data(), static_cast<int>(ids_.size()), run, &call, save ? 1 : 0);

  // Worlds that failed are reset alone, with the keyframe of their last reset; the others went on.
  std::vector<int> failed;
  for (int w : ids_) {
    if (mjb_status(batch_)[w]) {
      failures_.push_back({w, fmt::format("MuJoCo: {}", mjb_error(batch_, w))});
    } else if (diverged_[w]) {
      const int warning = diverged_[w] - 1;
      const auto& stat = mjb_warning(batch_)[w * mjNWARNING + warning];
      failures_.push_back({w, fmt::format("MuJoCo: {} (at {:.4f} s)",
                                          mju_warningText(warning, stat.lastinfo), time(w))});
    } else {
      continue;
    }
    diverged_[w] = 0;
    derived_version_[w] = 0;
    failed.push_back(w);
  }
  if (!failed.empty() && call.op != Op::kVisit && call.op != Op::kStepRaw) {
    std::stable_sort(failed.begin(), failed.end(),
                     [this](int a, int b) { return reset_key_[a] < reset_key_[b]; });
    for (auto first = failed.begin(); first != failed.end();) {
      const auto last = std::find_if(first, failed.end(),
                                     [&](int w) { return reset_key_[w] != reset_key_[*first]; });
      std::vector<int> same(first, last);
      std::sort(same.begin(), same.end());
      Call reset = call;
      reset.op = Op::kReset;
      reset.key = reset_key_[*first];
      apply_ordered(batch_, same.data(), static_cast<int>(same.size()), run, &reset, 1);
      for (int w : same) {
        if (mjb_status(batch_)[w]) {
          throw RuntimeError(
              fmt::format("world {} fails even when reset: MuJoCo: {}", w, mjb_error(batch_, w)));
        }
      }
      first = last;
    }
  }
  std::exception_ptr first;
  for (std::exception_ptr& e : exceptions_) {
    if (e && !first) first = e;
    e = nullptr;
  }
  if (first) std::rethrow_exception(first);
}

}  // namespace mjsense
