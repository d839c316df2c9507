#pragma once
// B parallel worlds: a thin owner of MuJoCo's mjBatch (persistent, one mjData a world). Steps, resets, clocks, and the promise
// that after step(), reset() and forward() every derived field of a world belongs to its present state.

#include <mujoco/mjbatch.h>
#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/array.h"
#include "mjsense/core/sensor.h"

namespace mjsense {

// What happens inside the parallel pass over worlds, on MuJoCo's threads. Exceptions are caught, and rethrown by the call.
class WorldHooks {
 public:
  virtual ~WorldHooks() = default;
  virtual bool wants_substep() const { return false; }
  virtual void substep(const World& world) = 0;  // after every physics step, world fresh
  virtual void refreshed(const World& world) = 0;  // once, at the end of step/reset/forward, world fresh
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
  mjBatch* batch() { return batch_; }

  // A new seed starts ticks and episodes again at 0 (of all worlds).
  void seed(std::uint64_t seed);
  std::uint64_t seed() const { return seed_; }

  // Empty ids: every world. Ids are checked (range, duplicates) and may come in any order.
  void step(int substeps, WorldHooks& hooks);
  void forward(std::span<const int> ids, WorldHooks& hooks);
  // key: keyframe, -1 the model's defaults.
  void reset(std::span<const int> ids, int key, WorldHooks& hooks);
  // The same without making anything current: plain mj_step, as MuJoCo's users know it.
  void step_raw(int substeps);
  // Runs body on the worlds' fresh data; nothing of the state changes.
  void visit(std::span<const int> ids, WorldHooks& hooks);

  // Worlds that failed in the last call, by index. Their state is the reset state.
  const std::vector<Failure>& failures() const { return failures_; }

  // Live views of the state rows, [B, n] float64, strided. Call forward() after writing.
  // Names: time qpos qvel act ctrl qfrc_applied xfrc_applied mocap_pos mocap_quat qacc_warmstart eq_active userdata.
  ArrayView state_component(std::string_view name);
  ArrayView state();  // [B, nstate], mjSTATE_INTEGRATION

  std::int64_t substeps(int world) const { return clocks_[world].substep; }
  double time(int world) const;
  std::vector<int> checked_ids(std::span<const int> ids) const;

 private:
  struct Clock {
    std::int64_t substep = 0, tick = 0, episode = 0;
    bool first = true;
  };
  struct Call;
  static void run(const mjModel* m, mjData* d, int w, void* arg);
  void apply(std::span<const int> ids, Call& call);

  mjBatch* batch_ = nullptr;
  int num_worlds_;
  std::uint64_t seed_ = 0;
  std::vector<Clock> clocks_;
  std::vector<Failure> failures_;
};

}  // namespace mjsense
