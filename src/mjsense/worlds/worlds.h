// SPDX-License-Identifier: Apache-2.0
#pragma once
// B parallel worlds: a thin owner of MuJoCo's mjBatch (persistent, one mjData a world). Steps,
// resets, clocks, and the promise that whoever looks at a world sees derived fields that belong to
// its present state.
//
// MuJoCo computes them in stages (mjtStage): positions, velocities, accelerations with the
// constraint solve. A world remembers how far it got at its present state. A stage is computed when
// somebody reads it, at most once for a state, and the next step starts from what is there.

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

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

namespace mjsense {

// What happens inside the parallel pass over worlds, on MuJoCo's threads. Exceptions are caught,
// and rethrown by the call. "Fresh": derived fields up to the stage named belong to the state.
class WorldHooks {
 public:
  virtual ~WorldHooks() = default;
  // The last stage that refreshed() and substep() read; mjSTAGE_NONE: the state alone.
  virtual mjtStage stage() const { return mjSTAGE_ACC; }
  virtual mjtStage substep_stage() const { return mjSTAGE_ACC; }
  virtual bool wants_substep() const { return false; }
  virtual void substep(const World& world) = 0;  // after every physics step, world fresh
  // Controllers that look at the state: control() is called before physics steps 0, n, 2n ... of a
  // step(), n = control_every(); 0: never. Of the world the state alone is current; controls and
  // mocap poses may be written. Returns the last stage that is still valid then: mjSTAGE_VEL after
  // controls, mjSTAGE_NONE after mocap poses, mjSTAGE_ACC if nothing was written. `index` counts.
  virtual int control_every() const { return 0; }
  virtual mjtStage control(const World& /*world*/, int /*index*/) { return mjSTAGE_ACC; }
  virtual void reset(const World& world) = 0;  // a new episode begins; fresh in all stages
  virtual void refreshed(
      const World& world) = 0;  // once, at the end of step/reset/forward/visit, world fresh
};

// A world whose physics went wrong in the last call. It was reset alone; the others went on.
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
  // As this world has it: the model, with the world's own values in the place of arrays that differ between worlds
  // (options stay the model's). It holds no memory of its own (no mj_deleteModel), and is valid as long as the worlds are.
  mjModel model_of(int world) const;
  mjBatch* batch() { return batch_; }

  // A new seed starts ticks and episodes again at 0 (of all worlds).
  void seed(std::uint64_t seed);
  std::uint64_t seed() const { return seed_; }
  // From here on this world draws as world `key` would, ticks and episodes from 0: an episode that
  // always takes the same key draws the same numbers in whatever world it runs.
  void rekey(int world, std::uint32_t key);

  // Ids are checked (range, duplicates) before anything happens.
  void step(int substeps, WorldHooks& hooks, WorldIds ids = all_worlds);
  void forward(WorldIds ids, WorldHooks& hooks);
  // key: keyframe, -1 the model's defaults.
  void reset(WorldIds ids, int key, WorldHooks& hooks);
  // Plain mj_step: derived fields stay one substep behind the state, as MuJoCo's users know it.
  void step_raw(int substeps);
  // Keeps the bodies of these free joints, and no others, at rest where the world's state has them, until the world's
  // next reset: after every physics step their poses are written back and their velocities are zero. For bodies that
  // take no part.
  void hold(int world, std::span<const int> joints);
  // refreshed() on worlds as they are. State rows written since the last call are made current
  // first.
  void visit(WorldIds ids, WorldHooks& hooks);
  // Model fields of the batch (mjb_expand) were written: the next step must not reuse what was
  // computed from the old ones.
  void model_changed() { model_version_++; }

  // Worlds that failed in the last call, by index. Their state is the reset state; after step_raw(),
  // which lets MuJoCo do with a world that diverges what it always does, it is as that left it.
  const std::vector<Failure>& failures() const { return failures_; }

  // Live views of the state rows, [B, n] float64, strided. Call forward() after writing.
  // Names: time qpos qvel act ctrl qfrc_applied xfrc_applied mocap_pos mocap_quat qacc_warmstart
  // eq_active userdata.
  ArrayView state_component(std::string_view name);
  ArrayView state();  // [B, nstate], mjSTATE_INTEGRATION

  std::int64_t substeps(int world) const { return clocks_[world].substep; }
  double time(int world) const;
  // The ids in order, all of them written out. Throws ValueError for one out of range or given twice.
  [[nodiscard]] std::vector<int> checked_ids(WorldIds ids) const;
  void checked_ids(WorldIds ids, std::vector<int>& sorted) const;  // into a buffer

 private:
  struct Clock {
    std::int64_t substep = 0, tick = 0, episode = 0;
    std::uint32_t key = 0;
    std::uint64_t moment = 0;
  };
  // Which of a world's derived fields belong to its remembered state row.
  struct Derived {
    mjtStage stage = mjSTAGE_NONE;   // up to here
    bool behind = false;             // step_raw() left them one substep behind, and so they stay
    std::int64_t model_version = 0;  // of the model they were computed with
  };
  // A free joint that is held, and the pose in which it is.
  struct Held {
    int qpos, dof;  // addresses
    mjtNum pose[7];
  };
  enum class Op { kStep, kForward, kReset, kStepRaw, kVisit };
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
  bool step_unseen(const mjModel* m, mjData* d, int w, const Call& call);
  bool step_whole(const mjModel* m, mjData* d, int w, const Call& call);
  bool healthy(int w, const Warnings& warnings);
  void keep_held(mjData* d, int w) const;
  void apply(WorldIds ids, Call call, bool save);
  std::vector<int> take_failures(Op op);
  std::string reset_failed(std::vector<int> failed, Call call);
  World view(const mjModel* m, mjData* d, int w) const;
  bool same_state(int w) const;
  bool same_controls(int w) const;
  bool same_columns(int w, std::size_t begin, std::size_t end) const;
  void remember(const mjModel* m, const mjData* d, int w);
  void bring(const mjModel* m, mjData* d, int w, mjtStage stage);
  void bring_late(const mjModel* m, mjData* d, int w, mjtStage stage);

  mjBatch* batch_ = nullptr;
  int num_worlds_;
  std::size_t num_state_ = 0;
  std::uint64_t seed_ = 0;
  std::int64_t model_version_ = 0;
  std::vector<Clock> clocks_;
  std::vector<std::vector<Held>> held_;  // by world
  std::vector<int> reset_key_;           // keyframe of each world's last reset
  std::vector<mjtNum> remembered_;       // state rows to which the derived fields belong
  std::vector<Derived> derived_;
  std::vector<std::exception_ptr> exceptions_;  // of hooks, by world
  std::vector<std::uint8_t> diverged_;          // by world: mjtWarning + 1 in this call
  std::vector<Failure> failures_;
  std::vector<int> ids_;  // scratch: the sorted selection
  // One mjData a thread, in which worlds are stepped that nobody looks at.
  struct Workbench {
    mjData* data = nullptr;
    std::atomic<bool> taken = false;
  };
  std::vector<Workbench> workbenches_;
  // Part of a state row that the position and velocity stages do not read: warm start, controls
  // and applied forces.
  std::size_t ctrl_begin_ = 0, ctrl_end_ = 0;
};

}  // namespace mjsense
