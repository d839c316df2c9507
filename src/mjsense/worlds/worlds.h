// SPDX-License-Identifier: Apache-2.0
#pragma once
// B parallel worlds in MuJoCo's mjBatch (persistent, one mjData per world): steps, resets, clocks,
// and the guarantee that derived fields always belong to the current state when they are read.
//
// MuJoCo computes derived fields in stages (mjtStage): positions, velocities, and accelerations
// with the constraint solve. A world keeps track of the last stage computed for its current state.
// A stage is computed when it is read, at most once per state, and the next step starts from the
// stages that are available.

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <array>
#include <atomic>
#include <cstdint>
#include <exception>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/sensor.h"
#include "mjsense/worlds/world_ids.h"

namespace mjsense::worlds {

// Callbacks inside the parallel pass over worlds, on MuJoCo's threads. Exceptions are caught and
// rethrown by the call. "Fresh" means that the derived fields up to the given stage belong to the
// state.
class WorldHooks {
 public:
  virtual ~WorldHooks() = default;
  // The last stage that refreshed() and substep() read; mjSTAGE_NONE: only the state.
  virtual mjtStage stage() const { return mjSTAGE_ACC; }
  virtual mjtStage substep_stage() const { return mjSTAGE_ACC; }
  virtual bool wants_substep() const { return false; }
  virtual void substep(const World& world) = 0;  // after every physics step; world is fresh
  // Controllers that read the state. control() is called before physics steps 0, n, 2n ... of a
  // step(), with n = control_every(); 0: never. Only the state of the world is current; control()
  // may write controls and mocap poses. It returns the last stage that is still valid: mjSTAGE_VEL
  // after it wrote controls, mjSTAGE_NONE after mocap poses, mjSTAGE_ACC if it wrote nothing.
  // `index` counts the calls.
  virtual int control_every() const { return 0; }
  virtual mjtStage control(const World& /*world*/, int /*index*/) { return mjSTAGE_ACC; }
  virtual void reset(const World& world) = 0;  // a new episode begins; all stages are fresh
  virtual void refreshed(
      const World& world) = 0;  // once, at the end of step/reset/forward/visit, world fresh
};

// A world whose physics diverged in the last call. Only this world was reset; the others continued.
// If MuJoCo raises an error in the reset too, for example because of a value in the world's model,
// its text is the message. Such a world is broken: its rows keep their last values, and each step(),
// forward() and reset() tries to reset it again. A call whose worlds are all broken throws.
struct Failure {
  int world;
  std::string message;  // MuJoCo's text, or the warning it raised ("bad qacc at 0.314 s")
};

class Worlds {
 public:
  Worlds(const mjModel* model, int num_worlds, int threads);
  ~Worlds();
  Worlds(const Worlds&) = delete;
  Worlds& operator=(const Worlds&) = delete;

  int size() const { return num_worlds_; }
  int threads() const;
  const mjModel* model() const;
  // The model with the values of this world in the arrays and options that differ between worlds. It
  // owns no memory (do not call mj_deleteModel) and is valid as long as the worlds are, its options
  // until they are written.
  mjModel model_of(int world) const;
  // Writes this world's values into `copy`, a copy of model().
  void write_model(int world, mjModel* copy) const;
  mjBatch* batch() { return batch_; }

  // Sets the seed, and the ticks and episodes of all worlds to 0.
  void seed(std::uint64_t seed);
  std::uint64_t seed() const { return seed_; }
  // From now on this world draws the random numbers of world `key`, with ticks and episodes from 0.
  // An episode that always uses the same key draws the same numbers in every world.
  void rekey(int world, std::uint32_t key);

  // All ids are checked (range, duplicates) before anything else happens.
  void step(int substeps, WorldHooks& hooks, WorldIds ids = all_worlds);
  void forward(WorldIds ids, WorldHooks& hooks);
  // The caller has stepped these worlds itself, `substeps` times each, and has written the resulting
  // states. Their clocks and the sensors' memory advance by that time.
  void follow(int substeps, WorldHooks& hooks, WorldIds ids = all_worlds);
  // key: keyframe index; -1: the model's defaults; kWrittenState: the state that the caller wrote.
  static constexpr int kWrittenState = -2;
  void reset(WorldIds ids, int key, WorldHooks& hooks);
  // Plain mj_step: derived fields stay one substep behind the state, as usual in MuJoCo.
  void step_raw(int substeps);
  // Holds the bodies of these free joints at rest where the world's state has them, until the world's
  // next reset, and releases all others: after every physics step their poses are written back and
  // their velocities are set to zero. Used for absent bodies.
  void hold(int world, std::span<const int> joints);
  std::vector<int> held(int world) const;  // the free joints that are held in this world
  // Calls refreshed() without stepping. State rows written since the last call are taken into
  // account.
  void visit(WorldIds ids, WorldHooks& hooks);
  // Call after model fields of the batch (mjb_expand) were written: the next step then does not
  // reuse results of the old values.
  void model_changed() { model_version_++; }
  // Number of calls of model_changed().
  std::int64_t model_version() const { return model_version_; }

  // Worlds that failed in the last call, by index. They were reset. Only after step_raw() a failed
  // world is as MuJoCo left it, because MuJoCo handles divergence itself there.
  const std::vector<Failure>& failures() const { return failures_; }

  // Number of times that each of MuJoCo's warnings (mjtWarning) was raised in this world since
  // construction. The first warning of each kind is also reported through MuJoCo's handler, with
  // its world; later ones are only counted.
  using WarningCounts = std::array<std::int64_t, mjNWARNING>;
  const WarningCounts& warning_counts(int world) const { return warning_counts_[world]; }

  // Live views of the state rows, [B, n] float64, strided. Call forward() after writing.
  // Names: time qpos qvel act ctrl qfrc_applied xfrc_applied mocap_pos mocap_quat qacc_warmstart
  // eq_active userdata.
  ArrayView state_component(std::string_view name);
  ArrayView state();  // [B, nstate], mjSTATE_INTEGRATION

  std::int64_t substeps(int world) const { return clocks_[world].substep; }
  double time(int world) const;
  // The ids, sorted and with `all_worlds` expanded. Throws ValueError for ids that are out of range
  // or duplicate.
  [[nodiscard]] std::vector<int> checked_ids(WorldIds ids) const;
  void checked_ids(WorldIds ids, std::vector<int>& sorted) const;  // the same into a buffer

 private:
  Worlds() = default;

  struct Clock {
    std::int64_t substep = 0, tick = 0, episode = 0;
    std::uint32_t key = 0;
    std::uint64_t moment = 0;
  };
  // Which of a world's derived fields are valid for its remembered state row.
  struct Derived {
    mjtStage stage = mjSTAGE_NONE;  // the last valid stage
    // step_raw() left them one substep behind, where they stay until the next step.
    bool behind = false;
    std::int64_t model_version = 0;  // version of the model they were computed with
  };
  // A free joint that is held, and its pose.
  struct Held {
    int joint, qpos, dof;  // id and addresses
    mjtNum pose[7];
  };
  enum class Op { kStep, kFollow, kForward, kReset, kStepRaw, kVisit };
  class Warnings;
  struct Call {
    Worlds* self;
    Op op;
    int substeps;
    int key;
    WorldHooks* hooks;
  };
  static void run(const mjModel* m, mjData* d, int w, void* arg);
  void run_world(const mjModel* m, mjData* d, int w, const Call& call);
  bool step_world(const mjModel* m, mjData* d, int w, const Call& call);
  void follow_world(const mjModel* m, mjData* d, int w, const Call& call);
  bool step_in_scratch(const mjModel* m, mjData* d, int w, const Call& call);
  bool step_in_place(const mjModel* m, mjData* d, int w, const Call& call);
  bool healthy(int w, const Warnings& warnings);
  void keep_held(mjData* d, int w) const;
  void apply(WorldIds ids, Call call, bool save);
  void count_warnings(const mjData* d, int w, const int* before);
  void report_warnings();
  std::vector<int> take_failures(Op op);
  std::string reset_failed(std::vector<int> failed, Call call);
  void restart(const mjModel* m, mjData* d, int w, int key, WorldHooks& hooks);
  World view(const mjModel* m, mjData* d, int w) const;
  bool same_state(int w) const;
  bool same_controls(int w) const;
  bool same_columns(int w, std::size_t begin, std::size_t end) const;
  void remember(const mjModel* m, const mjData* d, int w);
  void compute_stage(const mjModel* m, mjData* d, int w, mjtStage stage);
  void compute_late_stage(const mjModel* m, mjData* d, int w, mjtStage stage);

  mjBatch* batch_ = nullptr;
  int num_worlds_ = 0;
  std::size_t num_state_ = 0;
  std::uint64_t seed_ = 0;
  std::int64_t model_version_ = 0;
  std::vector<Clock> clocks_;
  std::vector<std::vector<Held>> held_;  // by world
  std::vector<int> reset_key_;           // keyframe of each world's last reset
  std::vector<std::uint8_t> broken_;     // by world: MuJoCo raised an error in its last reset
  std::vector<mjtNum> remembered_;       // state rows that the derived fields belong to
  std::vector<Derived> derived_;
  std::vector<std::exception_ptr> exceptions_;  // of hooks, by world
  std::vector<std::uint8_t> diverged_;          // by world: mjtWarning + 1 in this call
  std::vector<Failure> failures_;
  std::vector<WarningCounts> warning_counts_;  // by world
  std::array<bool, mjNWARNING> reported_{};    // by warning
  std::atomic<bool> warned_ = false;           // a count has risen in this call
  std::vector<int> ids_;                       // scratch: the sorted selection
  // One mjData per thread, used to step worlds whose derived fields are not read.
  struct ScratchSlot {
    mjData* data = nullptr;
    std::atomic<bool> taken = false;
  };
  std::vector<ScratchSlot> scratch_slots_;
  // Columns of a state row that do not affect the position and velocity stages: warm start,
  // controls and applied forces.
  std::size_t ctrl_begin_ = 0, ctrl_end_ = 0;
};

}  // namespace mjsense::worlds
