// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/worlds.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/core/system/os.h"
#include "mjsense/core/system/process_state.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/scene/mujoco_log.h"
#include "mjsense/worlds/ordered_apply.h"

namespace mjsense::worlds {
namespace {

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

// The default constructor comes first, so that the destructor runs if this one throws.
Worlds::Worlds(const mjModel* model, int num_worlds, int threads) : Worlds() {
  num_worlds_ = num_worlds;
  if (num_worlds < 1)
    throw ValueError(fmt::format("num_worlds is {}: must be at least 1", num_worlds));
  if (threads < 0 || threads > kMaxThreads)
    throw ValueError(fmt::format("threads is {}: must be 0 (all) to {}", threads, kMaxThreads));
  check_memory(model, num_worlds);
  scene::install_warning_filter();
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

void Worlds::step(int substeps, WorldHooks& hooks, WorldIds ids) {
  if (substeps < 1) throw ValueError(fmt::format("substeps is {}: must be at least 1", substeps));
  apply(ids, {this, Op::kStep, substeps, -1, &hooks}, true);
}

void Worlds::follow(int substeps, WorldHooks& hooks, WorldIds ids) {
  if (substeps < 1) throw ValueError(fmt::format("substeps is {}: must be at least 1", substeps));
  apply(ids, {this, Op::kFollow, substeps, -1, &hooks}, true);
}

void Worlds::forward(WorldIds ids, WorldHooks& hooks) {
  apply(ids, {this, Op::kForward, 0, -1, &hooks}, true);
}

void Worlds::reset(WorldIds ids, int key, WorldHooks& hooks) {
  if (key < kWrittenState || key >= model()->nkey) {
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

// Runs on MuJoCo's threads. A MuJoCo error jumps over this frame, so it must not hold objects with
// destructors.
void Worlds::run(const mjModel* m, mjData* d, int w, void* arg) {
  ordered_after(arg);
  const Call& call = *static_cast<const Call*>(arg);
  int before[mjNWARNING];
  for (int i = 0; i < mjNWARNING; ++i)
    before[i] = call.op == Op::kReset ? 0 : d->warning[i].number;  // a reset starts counting at 0
  scene::drop_warnings(true);
  try {
    call.self->run_world(m, d, w, call);
  } catch (...) {
    call.self->exceptions_[w] = std::current_exception();
  }
  scene::drop_warnings(false);
  call.self->count_warnings(d, w, before);
  orders_before(arg);
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
  scene::drop_warnings(false);  // an error leaves the flag set
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

}  // namespace mjsense::worlds
