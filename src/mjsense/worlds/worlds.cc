// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/worlds.h"

#include <fmt/format.h>
#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/core/os.h"
#include "mjsense/core/parallel.h"
#include "mjsense/core/process_state.h"

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
constexpr int kBadState = mjNWARNING;  // not a warning of MuJoCo's: written state is no number
constexpr int kFatalWarnings[] = {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_BADCTRL};

// Whether a step may be mj_step taken apart, so that it starts from stages that are there already
// and leaves out what nobody reads. Otherwise it is mj_step whole: a callback or a plugin may count
// how often it is asked, MuJoCo's own delays and histories take sensors at every substep, and
// sleep, IPC and the discrete integrator do more than the stages.
bool can_split_step(const mjModel* m) {
  const int whole = mjENBL_SLEEP | mjENBL_IPC | mjENBL_SPECULATIVE | mjENBL_FWDINV;
  const bool callbacks = mjcb_passive || mjcb_control || mjcb_contactfilter || mjcb_sensor ||
                         mjcb_act_dyn || mjcb_act_gain || mjcb_act_bias;
  return m->opt.integrator != mjINT_DISCRETE && !(m->opt.enableflags & whole) && !callbacks &&
         m->nhistory == 0 && m->nplugin == 0;
}

// mj_forward up to velocities; without `sensors` MuJoCo's own sensors keep their old values.
void position_and_velocity(const mjModel* m, mjData* d, bool sensors) {
  mj_fwdPosition(m, d);
  if (sensors) mj_sensorPos(m, d);
  const bool energy = m->opt.enableflags & mjENBL_ENERGY;
  if (!d->flg_energypos) {
    if (energy) {
      mj_energyPos(m, d);
    } else {
      d->energy[0] = d->energy[1] = 0;
    }
  }
  mj_fwdVelocity(m, d);
  if (sensors) mj_sensorVel(m, d);
  if (energy && !d->flg_energyvel) mj_energyVel(m, d);
}

// The state, and what MuJoCo counts.
void carry(const mjModel* m, const mjData* from, mjData* to) {
  mj_copyState(m, from, to, mjSTATE_INTEGRATION);
  std::copy_n(from->warning, mjNWARNING, to->warning);
  std::copy_n(from->timer, mjNTIMER, to->timer);
}

// MuJoCo warns of a bad control when it uses it: forces made with one are not to be reused.
bool bad_control(const mjModel* m, const mjData* d) {
  return std::any_of(d->ctrl, d->ctrl + m->nu, [](mjtNum x) { return mju_isBad(x); });
}

// mj_step from the stage that is there. MuJoCo's sensors are left out: nobody sees them between the
// stages before the integration and those after it.
void step_from(mjtStage stage, const mjModel* m, mjData* d) {
  if (stage < mjSTAGE_VEL) position_and_velocity(m, d, false);
  if (stage < mjSTAGE_ACC) mj_forwardSkip(m, d, mjSTAGE_VEL, 1);
  mj_checkAcc(m, d);
  switch (m->opt.integrator) {
    case mjINT_EULER:
      return mj_Euler(m, d);
    case mjINT_RK4:
      return mj_RungeKutta(m, d, 4);
    default:
      return mj_implicit(m, d);
  }
}

// The name of the first component of a state that holds NaN or infinity; "" if none does.
std::string_view bad_component(mjBatch* batch, int w) {
  const auto size = static_cast<std::size_t>(mjb_nstate(batch));
  const mjtNum* row = mjb_state(batch) + w * size;
  // A sum of zeros is none if a term is bad; such states are rare and looked at twice.
  mjtNum sum = 0;
  for (std::size_t i = 0; i < size; ++i) sum += row[i] * 0;
  if (sum == 0) return "";
  for (const Component& c : kComponents) {
    int count = 0;
    const mjtNum* part = mjb_stateComponent(batch, c.bit, &count) + w * size;
    for (int i = 0; i < count; ++i) {
      if (!std::isfinite(part[i])) return c.name;
    }
  }
  return "";
}

// A world is one mjData and three copies of its state: asked for too many, MuJoCo would end the
// program, or the system would.
void check_memory(const mjModel* m, int num_worlds) {
  mjData* d = mj_makeData(m);
  const std::uint64_t state = 3 * sizeof(mjtNum) * mj_stateSize(m, mjSTATE_INTEGRATION);
  const std::uint64_t each = sizeof(mjData) + d->nbuffer + state, space = each + d->narena;
  mj_deleteData(d);
  const auto require = [&](std::uint64_t needed, std::uint64_t available, const char* what) {
    if (needed > available)
      throw ValueError(fmt::format("num_worlds is {}: they need {} of {}, and {} are left",
                                   num_worlds, gigabytes(needed), what, gigabytes(available)));
  };
  require(each * num_worlds, os::free_memory(), "memory");
  require(space * num_worlds, available_address_space(), "address space");
}

}  // namespace

// The warnings that a world had before, to see which came.
class Worlds::Warnings {
 public:
  explicit Warnings(const mjData* d) : d_(d) {
    for (int i = 0; i < kNum; ++i) before_[i] = d->warning[kFatalWarnings[i]].number;
  }
  // The first fatal one since, -1 if none.
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

Worlds::Worlds(const mjModel* model, int num_worlds, int threads) : num_worlds_(num_worlds) {
  if (num_worlds < 1)
    throw ValueError(fmt::format("num_worlds is {}: must be at least 1", num_worlds));
  if (threads < 0 || threads > kMostThreads)
    throw ValueError(fmt::format("threads is {}: must be 0 (all) to {}", threads, kMostThreads));
  check_memory(model, num_worlds);
  mjBatchConfig config;
  mjb_defaultConfig(&config);
  config.nthread = threads > 0 ? threads : available_cpus();
  config.persistent = 1;
  char error[1024] = "";
  // A byte for every box around triangles, for viewers that show which boxes were looked at: cleared
  // at every substep, 0.4 MB a world for a Go1 with its meshes. Nobody sees ours. The batch copies.
  mjModel unmarked = *model;
  unmarked.vis.global.bvactive = 0;
  batch_ = mjb_makeBatch(&unmarked, num_worlds, &config, error, sizeof error);
  if (batch_) add_owner(this);
  if (!batch_) throw RuntimeError(fmt::format("cannot make {} worlds: {}", num_worlds, error));
  num_state_ = static_cast<std::size_t>(mjb_nstate(batch_));
  workbenches_ = std::vector<Workbench>(mjb_nthread(batch_));
  for (Workbench& bench : workbenches_) bench.data = mj_makeData(mjb_model(batch_));
  clocks_.resize(num_worlds);
  seed(0);
  held_.resize(num_worlds);
  reset_key_.assign(num_worlds, -1);
  remembered_.resize(num_worlds * num_state_);
  derived_.resize(num_worlds);
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

Worlds::~Worlds() {
  if (forget_owner(this)) return;  // MuJoCo's pool would wait for threads that are not here
  mjb_deleteBatch(batch_);
  for (Workbench& bench : workbenches_) mj_deleteData(bench.data);
}

int Worlds::threads() const { return mjb_nthread(batch_); }
const mjModel* Worlds::model() const { return mjb_model(batch_); }

mjModel Worlds::model_of(int world) const {
  mjModel mine = *model();
  int size = 0;
#define X(type, name, nr, nc)                                         \
  if (const void* rows = mjb_expanded(batch_, #name, &size, nullptr)) \
    mine.name = static_cast<type*>(const_cast<void*>(rows)) + std::ptrdiff_t{size} * world;
  MJMODEL_POINTERS
#undef X
  return mine;
}

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

bool Worlds::same_columns(int w, std::size_t begin, std::size_t end) const {
  const std::size_t row = w * num_state_;
  return std::memcmp(mjb_state(batch_) + row + begin, remembered_.data() + row + begin,
                     (end - begin) * sizeof(mjtNum)) == 0;
}

// True if neither the model nor what positions and velocities follow from was written since.
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

// Derived fields up to `stage`, MuJoCo's sensors among them, belong to the state.
void Worlds::bring(const mjModel* m, mjData* d, int w, mjtStage stage) {
  mjtStage& now = derived_[w].stage;
  if (stage == mjSTAGE_POS) stage = mjSTAGE_VEL;  // the next step wants both
  if (now < mjSTAGE_VEL && now < stage) {
    position_and_velocity(m, d, true);
    now = mjSTAGE_VEL;
  }
  if (now < mjSTAGE_ACC && now < stage) {
    mj_forwardSkip(m, d, mjSTAGE_VEL, 0);
    now = mjSTAGE_ACC;
  }
}

// The same some time after the state came about. Controls written meanwhile take effect at the next
// step: the forces that are measured are still those of the old ones.
void Worlds::bring_late(const mjModel* m, mjData* d, int w, mjtStage stage) {
  if (derived_[w].stage >= stage) return;
  constexpr int kControls =
      mjSTATE_WARMSTART | mjSTATE_CTRL | mjSTATE_QFRC_APPLIED | mjSTATE_XFRC_APPLIED;
  const std::size_t controls = w * num_state_ + ctrl_begin_;
  const bool swap = stage == mjSTAGE_ACC && !same_controls(w);
  if (swap) mj_setState(m, d, remembered_.data() + controls, kControls);
  bring(m, d, w, stage);
  if (swap) mj_setState(m, d, mjb_state(batch_) + controls, kControls);
}

void Worlds::hold(int world, std::span<const int> joints) {
  const mjModel* m = model();
  int size = 0;
  const mjtNum* qpos = mjb_stateComponent(batch_, mjSTATE_QPOS, &size) + world * num_state_;
  held_[world].clear();
  for (int joint : joints) {
    if (joint < 0 || joint >= m->njnt || m->jnt_type[joint] != mjJNT_FREE)
      throw ValueError(fmt::format("hold: joint {} is not a free joint", joint));
    Held held{m->jnt_qposadr[joint], m->jnt_dofadr[joint], {}};
    std::copy_n(qpos + held.qpos, 7, held.pose);
    held_[world].push_back(held);
  }
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

// Advances one world by call.substeps and leaves it as fresh as somebody reads it. False if it
// diverged.
//
// Positions and velocities of a state are computed once, whether a sensor or the next substep wants
// them first. So is the constraint solve as long as the controls stay what they were: within a
// control step, and over its end if nobody wrote others. A fresh force costs at most one solve a
// control step.
bool Worlds::step_world(const mjModel* m, mjData* d, int w, const Call& call) {
  mjtStage& stage = derived_[w].stage;
  if (stage != mjSTAGE_NONE && (derived_[w].behind || !same_state(w))) stage = mjSTAGE_NONE;
  if (stage == mjSTAGE_ACC && (!same_controls(w) || bad_control(m, d))) stage = mjSTAGE_VEL;
  const bool seen = stage != mjSTAGE_NONE || call.hooks->wants_substep() ||
                    call.hooks->control_every() > 0 || call.hooks->stage() != mjSTAGE_NONE ||
                    !can_split_step(m);
  if (!(seen ? step_whole(m, d, w, call) : step_unseen(m, d, w, call))) return false;
  remember(m, d, w);
  return true;
}

bool Worlds::step_whole(const mjModel* m, mjData* d, int w, const Call& call) {
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
    stage = mjSTAGE_NONE;  // also if MuJoCo jumps out of the step
    if (split) {
      step_from(from, m, d);
    } else {
      mj_step(m, d);
    }
    keep_held(d, w);
    mj_checkPos(m, d);
    mj_checkVel(m, d);
    if (!healthy(w, warnings)) return false;
    ++clocks_[w].substep;
    ++clocks_[w].tick;
    ++clocks_[w].moment;
    if (every) {
      bring(m, d, w, call.hooks->substep_stage());
      call.hooks->substep(view(m, d, w));
    }
  }
  bring(m, d, w, call.hooks->stage());
  return healthy(w, warnings);
}

// A world that starts from its state alone and leaves nothing else: it is stepped in an mjData that
// the thread's worlds share and that stays in its cache. A hundred kilobytes for each of many worlds
// do not, which costs a tenth of a step of a Go1 (bench/physics.py: MuJoCo's batch with and without
// `persistent`).
bool Worlds::step_unseen(const mjModel* m, mjData* d, int w, const Call& call) {
  const int substeps = call.substeps;
  Workbench* bench = nullptr;
  for (Workbench& each : workbenches_) {
    if (each.taken.exchange(true)) continue;
    bench = &each;
    break;
  }
  if (!bench) return step_whole(m, d, w, call);  // an error of MuJoCo in this call left one behind
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

void Worlds::run_world(const mjModel* m, mjData* d, int w, const Call& call) {
  Derived& derived = derived_[w];
  switch (call.op) {
    case Op::kStep:
      if (!step_world(m, d, w, call)) return;  // apply() resets it
      break;
    case Op::kForward:
      if (!bad_component(batch_, w).empty()) {
        diverged_[w] = kBadState + 1;  // apply() resets it
        return;
      }
      derived.stage = mjSTAGE_NONE;
      bring(m, d, w, mjSTAGE_ACC);
      remember(m, d, w);
      ++clocks_[w].moment;
      break;
    case Op::kReset:
      if (call.key >= 0) {
        mj_resetDataKeyframe(m, d, call.key);
      } else {
        mj_resetData(m, d);
      }
      held_[w].clear();
      derived.stage = mjSTAGE_NONE;
      bring(m, d, w, mjSTAGE_ACC);
      remember(m, d, w);
      reset_key_[w] = call.key;
      clocks_[w].substep = 0;
      ++clocks_[w].episode;
      ++clocks_[w].moment;
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
      if (derived.behind) break;
      if (same_state(w)) {
        bring_late(m, d, w, call.hooks->stage());
      } else {
        derived.stage = mjSTAGE_NONE;
        remember(m, d, w);
        ++clocks_[w].moment;
        bring(m, d, w, call.hooks->stage());
      }
      break;
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
  if (is_orphan(this))
    throw RuntimeError(
        "simulation: this process was forked from the one that made it, and its threads stayed "
        "there; make it after the fork, or start processes with 'spawn'");
  checked_ids(ids, ids_);
  if (call.op != Op::kVisit) failures_.clear();
  if (ids_.empty()) return;  // MuJoCo would take it for all
  apply_ordered(batch_, ids_.data(), static_cast<int>(ids_.size()), run, &call, save ? 1 : 0);
  for (Workbench& bench : workbenches_) {  // left behind by an error
    if (bench.taken.exchange(false)) mj_resetData(model(), bench.data);
  }

  std::vector<int> failed = take_failures(call.op);
  std::string helpless;
  if (call.op != Op::kVisit && call.op != Op::kStepRaw)
    helpless = reset_failed(std::move(failed), call);
  std::exception_ptr first;
  for (std::exception_ptr& e : exceptions_) {
    if (e && !first) first = e;
    e = nullptr;
  }
  if (!helpless.empty()) throw RuntimeError(helpless);
  if (first) std::rethrow_exception(first);
}

// Worlds that failed in this call, of which failures_ tells why.
std::vector<int> Worlds::take_failures(Op op) {
  std::vector<int> failed;
  for (int w : ids_) {
    std::string why;
    if (mjb_status(batch_)[w]) {
      why = fmt::format("MuJoCo: {}", mjb_error(batch_, w));
    } else if (!diverged_[w]) {
      continue;
    } else if (const int warning = diverged_[w] - 1; warning == kBadState) {
      why = fmt::format("the state that was written holds NaN or infinity ({})",
                        bad_component(batch_, w));
    } else {
      const auto& stat = mjb_warning(batch_)[w * mjNWARNING + warning];
      why =
          fmt::format("MuJoCo: {} (at {:.4f} s)", mju_warningText(warning, stat.lastinfo), time(w));
    }
    if (op == Op::kVisit && mjb_status(batch_)[w]) {
      // Nothing happened that could be undone: the reader is told.
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

// They are reset alone, each with the keyframe of its last reset; the others went on. Returns what
// is to be said of one that fails even so.
std::string Worlds::reset_failed(std::vector<int> failed, Call call) {
  std::string helpless;
  std::ranges::stable_sort(failed, {}, [this](int w) { return reset_key_[w]; });
  call.op = Op::kReset;
  for (auto first = failed.begin(); first != failed.end();) {
    call.key = reset_key_[*first];
    const auto last =
        std::find_if(first, failed.end(), [&](int w) { return reset_key_[w] != call.key; });
    apply_ordered(batch_, &*first, static_cast<int>(last - first), run, &call, 1);
    for (; first != last; ++first) {
      if (mjb_status(batch_)[*first] && helpless.empty()) {
        helpless = fmt::format("world {} fails even when reset: MuJoCo: {}", *first,
                               mjb_error(batch_, *first));
      }
    }
  }
  return helpless;
}

}  // namespace mjsense
