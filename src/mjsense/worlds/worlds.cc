// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/worlds.h"

#include <fmt/format.h>
#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/core/os.h"
#include "mjsense/core/process_state.h"
#include "mjsense/core/thread_pool.h"
#include "mjsense/scene/mujoco_log.h"

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace mjsense {
namespace {

// MuJoCo's thread pool is not instrumented. These functions tell the thread sanitizer which
// accesses its atomics order. They do nothing in other builds.
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

// Calls mjb_apply and makes its ordering visible to the thread sanitizer.
void apply_ordered(mjBatch* batch, const int* ids, int n, mjfBatchFunc run, void* call, int save) {
  orders_before(call);
  mjb_apply(batch, ids, n, run, call, save);
  ordered_after(call);
}

struct Component {
  std::string_view name;
  int bit;
  int width;  // columns per element; 0: scalar elements, one column each
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

// Not one of MuJoCo's warnings: the state that was written contains NaN or infinity.
constexpr int kBadState = mjNWARNING;
// Warnings after which the state of a world is invalid. A bad control is one of them, because
// MuJoCo would silently replace it by zeros.
constexpr int kFatalWarnings[] = {mjWARN_BADQPOS, mjWARN_BADQVEL, mjWARN_BADQACC, mjWARN_BADCTRL};

// Whether mj_step may be split into stages, so that a step starts from stages that are already
// computed and skips those that are not read. Otherwise mj_step is called as a whole: callbacks and
// plugins may count their calls, MuJoCo's delays and histories sample sensors at every substep, and
// sleep, IPC and the discrete integrator do more than the stages.
bool can_split_step(const mjModel* m) {
  const int whole = mjENBL_SLEEP | mjENBL_IPC | mjENBL_SPECULATIVE | mjENBL_FWDINV;
  const bool callbacks = mjcb_passive || mjcb_control || mjcb_contactfilter || mjcb_sensor ||
                         mjcb_act_dyn || mjcb_act_gain || mjcb_act_bias;
  return m->opt.integrator != mjINT_DISCRETE && !(m->opt.enableflags & whole) && !callbacks &&
         m->nhistory == 0 && m->nplugin == 0;
}

// mj_forward up to the velocity stage. Without `sensors`, MuJoCo's own sensors keep their old
// values. Unlike in mj_forward, energies are computed before the sensors that report them: with
// <flag energy="enable"/>, MuJoCo's e_kinetic reports the energy of the previous forward.
void position_and_velocity(const mjModel* m, mjData* d, bool sensors) {
  const bool energy = m->opt.enableflags & mjENBL_ENERGY;
  mj_fwdPosition(m, d);
  if (energy) {
    mj_energyPos(m, d);
    mj_energyVel(m, d);  // of the inertia and qvel, which are there
  }
  if (sensors) mj_sensorPos(m, d);
  if (!d->flg_energypos) d->energy[0] = d->energy[1] = 0;
  mj_fwdVelocity(m, d);
  if (sensors) mj_sensorVel(m, d);
}

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

// mj_step from the stage that is already computed. MuJoCo's sensors are skipped, because they
// cannot be read between the stages before the integration and those after it.
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

// Name of the first state component that contains NaN or infinity; "" if there is none.
std::string_view bad_component(mjBatch* batch, int w) {
  const auto size = static_cast<std::size_t>(mjb_nstate(batch));
  const mjtNum* row = mjb_state(batch) + w * size;
  // The sum of zero multiples is 0 unless a term is NaN or infinite. Only then the components are
  // searched.
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

// Throws if the memory is insufficient. A world needs one mjData and three copies of its state. If
// allocation failed later, MuJoCo or the system would terminate the program.
void check_memory(const mjModel* m, int num_worlds) {
  mjData* d = nullptr;
  try {
    d = call_mujoco(mj_makeData, m);
  } catch (const RuntimeError& error) {
    throw RuntimeError(fmt::format("no world of this model fits into memory: {}", error.what()));
  }
  const std::uint64_t state = 3 * sizeof(mjtNum) * mj_stateSize(m, mjSTATE_INTEGRATION);
  const std::uint64_t each = sizeof(mjData) + d->nbuffer + state, space = each + d->narena;
  mj_deleteData(d);
  const auto require = [&](std::uint64_t needed, std::uint64_t available, const char* what) {
    if (needed > available)
      throw ValueError(
          fmt::format("num_worlds is {}: they need {} of {}, but only {} are available", num_worlds,
                      gigabytes(needed), what, gigabytes(available)));
  };
  require(each * num_worlds, os::free_memory(), "memory");
  require(space * num_worlds, available_address_space(), "address space");
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

// The default constructor comes first, so that the destructor runs if this one throws.
Worlds::Worlds(const mjModel* model, int num_worlds, int threads) : Worlds() {
  num_worlds_ = num_worlds;
  if (num_worlds < 1)
    throw ValueError(fmt::format("num_worlds is {}: must be at least 1", num_worlds));
  if (threads < 0 || threads > kMaxThreads)
    throw ValueError(fmt::format("threads is {}: must be 0 (all) to {}", threads, kMaxThreads));
  check_memory(model, num_worlds);
  install_warning_filter();
  mjBatchConfig config;
  mjb_defaultConfig(&config);
  config.nthread = threads > 0 ? threads : available_cpus();
  config.persistent = 1;
  char error[1024] = "";
  // bvactive fills one byte per bounding box of a mesh, for viewers that show which boxes were
  // tested. It is cleared at every substep and takes 0.4 MB per world for a Go1 with its meshes.
  // Nothing here reads it. The batch copies the model.
  mjModel unmarked = *model;
  unmarked.vis.global.bvactive = 0;
  batch_ = call_mujoco(mjb_makeBatch, &unmarked, num_worlds, &config, error, sizeof error);
  if (batch_) add_owner(this);
  if (!batch_) throw RuntimeError(fmt::format("cannot create {} worlds: {}", num_worlds, error));
  num_state_ = static_cast<std::size_t>(mjb_nstate(batch_));
  scratch_slots_ = std::vector<ScratchSlot>(mjb_nthread(batch_));
  for (ScratchSlot& bench : scratch_slots_)
    bench.data = call_mujoco(mj_makeData, mjb_model(batch_));
  clocks_.resize(num_worlds);
  seed(0);
  held_.resize(num_worlds);
  reset_key_.assign(num_worlds, -1);
  broken_.assign(num_worlds, 0);
  remembered_.resize(num_worlds * num_state_);
  derived_.resize(num_worlds);
  exceptions_.resize(num_worlds);
  diverged_.assign(num_worlds, 0);
  warning_counts_.resize(num_worlds);
  ids_.reserve(num_worlds);
  failures_.reserve(num_worlds);
  int size = 0;
  const mjtNum* row = mjb_state(batch_);
  ctrl_begin_ = mjb_stateComponent(batch_, mjSTATE_WARMSTART, &size) - row;
  ctrl_end_ = mjb_stateComponent(batch_, mjSTATE_XFRC_APPLIED, &size) - row;
  ctrl_end_ += size;
}

Worlds::~Worlds() {
  // MuJoCo's pool would wait for threads that do not exist after a fork.
  if (forget_owner(this)) return;
  mjb_deleteBatch(batch_);
  for (ScratchSlot& bench : scratch_slots_) mj_deleteData(bench.data);
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

void Worlds::write_model(int world, mjModel* copy) const {
  const auto write = [&](const char* field, void* to) {
    int size = 0, element = 0;
    const auto* rows = static_cast<const char*>(mjb_expanded(batch_, field, &size, &element));
    if (rows == nullptr) return;
    const std::size_t bytes = static_cast<std::size_t>(size) * element;
    std::memcpy(to, rows + bytes * world, bytes);
  };
#define X(type, name, nr, nc) write(#name, copy->name);
  MJMODEL_POINTERS
#undef X
#define X(type, name, size) write("opt." #name, &copy->opt.name);
#define XVEC X
  MJOPTION_FIELDS
#undef XVEC
#undef X
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
    throw ValueError(fmt::format(
        "keyframe {}: the model has {} keyframes (-1: the model's defaults)", key, model()->nkey));
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

void Worlds::hold(int world, std::span<const int> joints) {
  const mjModel* m = model();
  int size = 0;
  const mjtNum* qpos = mjb_stateComponent(batch_, mjSTATE_QPOS, &size) + world * num_state_;
  held_[world].clear();
  for (int joint : joints) {
    if (joint < 0 || joint >= m->njnt || m->jnt_type[joint] != mjJNT_FREE)
      throw ValueError(fmt::format("hold: joint {} is not a free joint", joint));
    Held held{joint, m->jnt_qposadr[joint], m->jnt_dofadr[joint], {}};
    std::copy_n(qpos + held.qpos, 7, held.pose);
    held_[world].push_back(held);
  }
}

std::vector<int> Worlds::held(int world) const {
  std::vector<int> joints;
  for (const Held& held : held_[world]) joints.push_back(held.joint);
  return joints;
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
  } else {
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

void Worlds::run_world(const mjModel* m, mjData* d, int w, const Call& call) {
  Derived& derived = derived_[w];
  if (broken_[w] && (call.op == Op::kStep || call.op == Op::kForward))
    restart(m, d, w, reset_key_[w], *call.hooks);
  switch (call.op) {
    case Op::kStep:
      if (!step_world(m, d, w, call)) return;  // apply() resets the world
      // MuJoCo checks positions, velocities, accelerations and controls, but no mocap pose.
      if (!bad_component(batch_, w).empty()) {
        diverged_[w] = kBadState + 1;
        return;
      }
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

// Runs on MuJoCo's threads. A MuJoCo error jumps over this frame, so it must not hold objects with
// destructors.
void Worlds::run(const mjModel* m, mjData* d, int w, void* arg) {
  ordered_after(arg);
  const Call& call = *static_cast<const Call*>(arg);
  int before[mjNWARNING];
  for (int i = 0; i < mjNWARNING; ++i)
    before[i] = call.op == Op::kReset ? 0 : d->warning[i].number;  // a reset starts counting at 0
  drop_warnings(true);
  try {
    call.self->run_world(m, d, w, call);
  } catch (...) {
    call.self->exceptions_[w] = std::current_exception();
  }
  drop_warnings(false);
  call.self->count_warnings(d, w, before);
  orders_before(arg);
}

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

void Worlds::apply(WorldIds ids, Call call, bool save) {
  if (is_orphan(this))
    throw RuntimeError(
        "simulation: this process was forked from the one that created it, which has its threads; "
        "create it after the fork, or start processes with 'spawn' or 'forkserver'");
  checked_ids(ids, ids_);
  if (call.op != Op::kVisit) failures_.clear();
  if (ids_.empty()) return;  // MuJoCo would interpret an empty list as all worlds
  apply_ordered(batch_, ids_.data(), static_cast<int>(ids_.size()), run, &call, save ? 1 : 0);
  drop_warnings(false);  // an error leaves the flag set
  report_warnings();
  for (ScratchSlot& bench : scratch_slots_) {  // left as taken by an error
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
    drop_warnings(false);
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

}  // namespace mjsense
