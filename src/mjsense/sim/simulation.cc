// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sim/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <functional>
#include <new>
#include <numeric>

#include "mjsense/core/control_step.h"
#include "mjsense/core/error.h"
#include "mjsense/core/row_error.h"
#include "mjsense/rays/ray_scene.h"

namespace mjsense {
namespace {

// Measures seconds since its construction. If off, returns 0 and does not read the clock, which
// takes 25 ns, as much as a small sensor.
class Timer {
 public:
  explicit Timer(bool on) : on_(on) {
    if (on_) start_ = std::chrono::steady_clock::now();
  }
  double seconds() const {
    if (!on_) return 0.0;
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  bool on_;
  std::chrono::steady_clock::time_point start_;
};

// A lack of memory in a sensor, with the sensor's name. It allocates nothing.
class SensorOutOfMemory : public std::bad_alloc {
 public:
  explicit SensorOutOfMemory(const Sensor& sensor) {
    std::snprintf(message_, sizeof message_, "sensor '%.80s': out of memory",
                  sensor.name().c_str());
  }
  const char* what() const noexcept override { return message_; }

 private:
  char message_[120];
};

// Runs `body` for a sensor. Errors that do not name the sensor get its name as a prefix.
template <class Body>
void guarded(const Sensor& sensor, Body&& body) {
  try {
    body();
  } catch (const RowError&) {
    throw;  // already names the sensor
  } catch (const Error& e) {
    const std::string named = fmt::format("'{}'", sensor.name());
    if (std::string_view(e.what()).find(named) != std::string_view::npos) throw;
    const std::string message = fmt::format("sensor {}: {}", named, e.what());
    switch (e.kind()) {
      case ErrorKind::kValue:
        throw ValueError(message);
      case ErrorKind::kKey:
        throw KeyError(message);
      case ErrorKind::kRuntime:
        throw RuntimeError(message);
    }
  } catch (const SensorOutOfMemory&) {
    throw;  // already names the sensor
  } catch (const std::bad_alloc&) {
    throw SensorOutOfMemory(sensor);
  }
}

// Runs `first`, then `next` until it returns false, even if they throw RowError, so that all
// listeners are notified although some rows could not be computed. Then the first exception is
// rethrown.
template <class First, class Next>
void after_all(First&& first, Next&& next) {
  std::exception_ptr fault;
  const auto keep = [&](auto&& body) {
    try {
      return body();
    } catch (const RowError&) {
      if (!fault) fault = std::current_exception();
      return true;
    }
  };
  keep([&] {
    first();
    return true;
  });
  while (keep(next)) {
  }
  if (fault) std::rethrow_exception(fault);
}

}  // namespace

// A sensor and the state of its rows.
struct Simulation::Slot {
  Sensor* sensor;
  std::vector<Slot*> inputs;
  // by world: version_ of the state that the row was computed from
  std::vector<std::int64_t> computed;
  std::vector<double> compute_s;  // by world
  double cast_s = 0;
  mjtStage needs = mjSTAGE_ACC;
  ControlStepListener* listener = nullptr;  // the sensor, if it is a ControlStepListener
  int phase = 0;        // number of earlier passes: 1 + the phase of an input that casts
  bool casts = false;   // stage kCast or kBatch: finished by cast()
  bool read = false;    // since the last step
  bool wanted = false;  // temporary flag of collect()
};

struct Simulation::Scratch {
  std::vector<Slot*> slots;
  std::vector<int> ids;
};

class Simulation::Borrowed {
 public:
  explicit Borrowed(Simulation& sim) : sim_(sim) {
    if (sim.scratch_.empty()) {
      scratch_ = std::make_unique<Scratch>();
    } else {
      scratch_ = std::move(sim.scratch_.back());
      sim.scratch_.pop_back();
    }
    scratch_->slots.clear();
    scratch_->ids.clear();
  }
  ~Borrowed() { sim_.scratch_.push_back(std::move(scratch_)); }
  Borrowed(const Borrowed&) = delete;
  Borrowed& operator=(const Borrowed&) = delete;
  Scratch* operator->() { return scratch_.get(); }

 private:
  Simulation& sim_;
  std::unique_ptr<Scratch> scratch_;
};

// Sensor callbacks of the parallel pass of MuJoCo's threads over the worlds.
class Simulation::Hooks final : public WorldHooks {
 public:
  enum class Only { kNothing, kSubstep, kReset };
  Hooks(Simulation& sim, std::span<Slot* const> slots, int phase)
      : sim_(sim), slots_(slots), phase_(phase) {
    for (const Slot* s : slots) {
      if (s->phase != phase) continue;
      rays_ |= s->sensor->stage() == Stage::kCast;
      stage_ = std::max(stage_, s->needs);
    }
    if (rays_) stage_ = std::max(stage_, mjSTAGE_POS);
  }

  // Calls only substep() or reset() of every sensor.
  Hooks(Simulation& sim, Only only, double elapsed = 0.0)
      : sim_(sim),
        only_(only),
        elapsed_(elapsed),
        stage_(only == Only::kSubstep ? sim.substep_stage_ : mjSTAGE_ACC) {}

  mjtStage stage() const override { return stage_; }
  mjtStage substep_stage() const override { return sim_.substep_stage_; }
  bool wants_substep() const override { return sim_.any_substep_; }

  int control_every() const override { return sim_.control_every_; }
  mjtStage control(const World& world, int index) override { return sim_.control_(world, index); }

  void substep(const World& world) override {
    for (auto& slot : sim_.slots_) {
      if (slot->sensor->wants_substep())
        guarded(*slot->sensor, [&] { slot->sensor->substep(world); });
    }
  }

  void reset(const World& world) override {
    for (auto& slot : sim_.slots_) guarded(*slot->sensor, [&] { slot->sensor->reset(world); });
  }

  void refreshed(const World& world) override {
    if (only_ == Only::kSubstep) {
      World by_hand = world;
      by_hand.elapsed = elapsed_;
      return substep(by_hand);
    }
    if (only_ == Only::kReset) return reset(world);
    const std::int64_t version = sim_.version_[world.id];
    if (rays_ && sim_.rays_version_[world.id] != version) {
      const Timer timer(sim_.measure_cost_);
      sim_.rays_->update(world);
      sim_.rays_s_[world.id] += timer.seconds();
      sim_.rays_version_[world.id] = version;
    }
    for (Slot* slot : slots_) {
      if (slot->phase != phase_ || slot->computed[world.id] == version) continue;
      const Timer timer(sim_.measure_cost_);
      guarded(*slot->sensor, [&] { slot->sensor->compute(world); });
      slot->compute_s[world.id] += timer.seconds();
      if (!slot->casts) slot->computed[world.id] = version;
    }
  }

 private:
  Simulation& sim_;
  std::span<Slot* const> slots_;
  int phase_ = 0;
  Only only_ = Only::kNothing;
  double elapsed_ = 0.0;
  mjtStage stage_ = mjSTAGE_NONE;
  bool rays_ = false;
};

Simulation::Simulation(std::shared_ptr<Scene> scene, const SimulationCfg& cfg)
    : cfg_(cfg), scene_(std::move(scene)) {
  if (cfg.decimation < 1)
    throw ValueError(fmt::format("decimation is {}: must be at least 1", cfg.decimation));
  claim_ = scene_->claim();
  worlds_ = std::make_unique<Worlds>(scene_->model(), cfg.num_worlds, cfg.threads);
  worlds_->seed(cfg.seed);
  // Not worlds_->threads(): MuJoCo's pool is limited to the number of worlds, but a single image
  // has many tiles.
  pool_ = std::make_unique<ThreadPool>(cfg.threads);
  version_.assign(cfg.num_worlds, 1);
  rays_version_.assign(cfg.num_worlds, 0);
  rays_s_.assign(cfg.num_worlds, 0.0);
  initialize_scene();
  reset();
}

Simulation::~Simulation() = default;

// Initializes in the order of the registry, except that a sensor follows those that it reads.
void Simulation::initialize_scene() {
  std::vector<Sensor*> done, open;
  const auto contains = [](const std::vector<Sensor*>& list, const Sensor* s) {
    return std::find(list.begin(), list.end(), s) != list.end();
  };
  const std::function<void(Sensor&)> visit = [&](Sensor& sensor) {
    if (contains(done, &sensor)) return;
    if (contains(open, &sensor)) {
      throw ValueError(fmt::format("sensor '{}': reads itself", sensor.name()));
    }
    open.push_back(&sensor);
    for (const std::string& key : sensor.initialization_dependencies()) {
      guarded(sensor, [&] { visit(scene_->sensor(key)); });
    }
    open.pop_back();
    initialize(sensor);
    done.push_back(&sensor);
  };
  for (auto& sensor : scene_->sensors()) visit(*sensor);
}

RayScene& Simulation::rays() {
  if (!rays_) rays_ = std::make_unique<RayScene>(scene_->model(), cfg_.num_worlds);
  return *rays_;
}

void Simulation::initialize(Sensor& sensor) {
  const SensorInit init{scene_->model(), scene_.get(),  cfg_.num_worlds,
                        cfg_.decimation, pool_->size(), &shared_};
  guarded(sensor, [&] { sensor.initialize(init); });
  auto slot = std::make_unique<Slot>();
  slot->sensor = &sensor;
  slot->listener = dynamic_cast<ControlStepListener*>(&sensor);
  slot->computed.assign(cfg_.num_worlds, 0);
  slot->compute_s.assign(cfg_.num_worlds, 0.0);
  slot->casts = sensor.stage() == Stage::kCast || sensor.stage() == Stage::kBatch;
  if (sensor.stage() == Stage::kPostCast) slot->phase = 1;
  for (const Sensor* input : sensor.inputs()) {
    Slot& in = slot_of(*input);
    slot->inputs.push_back(&in);
    slot->phase = std::max(slot->phase, in.phase + (in.casts ? 1 : 0));
  }
  if (sensor.stage() == Stage::kCast) rays();
  slot->needs = sensor.needs();
  if (sensor.wants_substep()) {
    any_substep_ = true;
    substep_stage_ = std::max(substep_stage_, slot->needs);
  }
  slots_.push_back(std::move(slot));
}

void Simulation::add(std::shared_ptr<Sensor> sensor) {
  initialize(*sensor);
  added_.push_back(std::move(sensor));
}

Simulation::Slot& Simulation::slot_of(const Sensor& sensor) const {
  for (auto& slot : slots_) {
    if (slot->sensor == &sensor) return *slot;
  }
  throw ValueError(fmt::format("sensor '{}' does not belong to this simulation: call add() first",
                               sensor.name()));
}

// Collects the slots for which `wanted` holds, and their inputs, in order: an input was initialized
// before the sensor that reads it.
template <class Wanted>
void Simulation::collect(std::vector<Slot*>& slots, Wanted&& wanted) {
  for (auto slot = slots_.rbegin(); slot != slots_.rend(); ++slot) {
    (*slot)->wanted |= wanted(**slot);
    if ((*slot)->wanted) {
      for (Slot* input : (*slot)->inputs) input->wanted = true;
    }
  }
  for (auto& slot : slots_) {
    if (slot->wanted) slots.push_back(slot.get());
    slot->wanted = false;
  }
}

void Simulation::mark_stale(std::span<const int> ids) {
  for (int w : ids) ++version_[w];
}

void Simulation::compute(std::span<Slot* const> slots, std::span<const int> ids, Change change,
                         int key) {
  int last_phase = 0;
  for (const Slot* slot : slots) last_phase = std::max(last_phase, slot->phase);
  for (int phase = 0; phase <= last_phase; ++phase) {
    Hooks hooks(*this, slots, phase);
    if (phase > 0) {
      worlds_->visit(ids, hooks);
    } else {
      switch (change) {
        case Change::kStep:
          after_all([&] { worlds_->step(cfg_.decimation, hooks, ids); },
                    // By index, because a listener may add sensors.
                    [&, i = std::size_t{0}]() mutable {
                      if (i == slots_.size()) return false;
                      const Slot& slot = *slots_[i++];
                      if (slot.listener)
                        guarded(*slot.sensor, [&] { slot.listener->control_step(ids); });
                      return true;
                    });
          break;
        case Change::kForward:
          worlds_->forward(ids, hooks);
          break;
        case Change::kReset:
          worlds_->reset(ids, key, hooks);
          break;
        case Change::kNone:
          worlds_->visit(ids, hooks);
          break;
      }
    }
    cast(slots, ids, phase);
  }
}

void Simulation::cast(std::span<Slot* const> slots, std::span<const int> ids, int phase) {
  for (const Stage stage : {Stage::kCast, Stage::kBatch}) {
    for (Slot* slot : slots) {
      if (slot->sensor->stage() != stage || slot->phase != phase) continue;
      Borrowed due(*this);
      for (int w : ids) {
        if (slot->computed[w] != version_[w]) due->ids.push_back(w);
      }
      if (due->ids.empty()) continue;
      const Timer timer(measure_cost_);
      try {
        guarded(*slot->sensor, [&] { slot->sensor->cast({rays_.get(), due->ids, *pool_}); });
      } catch (const RowError& e) {
        for (int w : due->ids) {
          if (std::ranges::find(e.faults, w, &RowError::Fault::world) == e.faults.end())
            slot->computed[w] = version_[w];
        }
        throw;
      }
      slot->cast_s += timer.seconds();
      for (int w : due->ids) slot->computed[w] = version_[w];
    }
  }
}

void Simulation::step(int control_steps, WorldIds ids) {
  if (control_steps < 1)
    throw ValueError(fmt::format("step({}): must be at least 1", control_steps));
  for (int k = 0; k < control_steps; ++k) {
    const bool last = k + 1 == control_steps;
    Borrowed due(*this);
    collect(due->slots, [last](Slot& s) {
      const bool wanted = s.sensor->needs_every_step() || (last && s.read);
      if (last) s.read = false;
      return wanted;
    });
    worlds_->checked_ids(ids, due->ids);
    mark_stale(due->ids);
    compute(due->slots, due->ids, Change::kStep);
  }
}

void Simulation::set_control(int every, Control control) {
  if (every < 1)
    throw ValueError(fmt::format("set_control: every is {}: must be at least 1", every));
  control_ = std::move(control);
  control_every_ = control_ ? every : 0;
}

void Simulation::reset(WorldIds ids, int key) {
  const std::vector<int> sorted = worlds_->checked_ids(ids);
  Borrowed due(*this);
  collect(due->slots, [](Slot& s) { return s.sensor->needs_every_step(); });
  mark_stale(sorted);
  compute(due->slots, sorted, Change::kReset, key);
}

void Simulation::forward(WorldIds ids) {
  const std::vector<int> sorted = worlds_->checked_ids(ids);
  Borrowed due(*this);
  collect(due->slots, [](Slot& s) { return s.sensor->needs_every_step(); });
  mark_stale(sorted);
  compute(due->slots, sorted, Change::kForward);
}

void Simulation::step_raw(int substeps) {
  invalidate();
  worlds_->step_raw(substeps);
}

void Simulation::update_sensors(double dt) {
  Hooks hooks(*this, Hooks::Only::kSubstep, dt);
  invalidate();
  worlds_->visit(all_worlds, hooks);
}

void Simulation::reset_sensors(WorldIds ids) {
  const std::vector<int> sorted = worlds_->checked_ids(ids);
  Hooks hooks(*this, Hooks::Only::kReset);
  mark_stale(sorted);
  worlds_->visit(sorted, hooks);
}

Simulation::Cost Simulation::cost(const Sensor& sensor) const {
  const Slot& slot = slot_of(sensor);
  return {std::accumulate(slot.compute_s.begin(), slot.compute_s.end(), 0.0), slot.cast_s};
}

double Simulation::ray_scene_cost() const {
  return std::accumulate(rays_s_.begin(), rays_s_.end(), 0.0);
}

void Simulation::invalidate(WorldIds ids) { mark_stale(worlds_->checked_ids(ids)); }

void Simulation::refresh(std::span<Sensor* const> sensors, WorldIds ids) {
  make_current(sensors, ids);
  // only after they were computed successfully
  for (const Sensor* sensor : sensors) slot_of(*sensor).read = true;
}

void Simulation::make_current(std::span<Sensor* const> sensors, WorldIds ids) {
  Borrowed due(*this);
  for (const Sensor* sensor : sensors) {
    slot_of(*sensor).wanted = true;
  }
  collect(due->slots, [](const Slot&) { return false; });
  worlds_->checked_ids(ids, due->ids);
  std::erase_if(due->ids, [&](int w) {
    return std::ranges::all_of(due->slots,
                               [&](const Slot* slot) { return slot->computed[w] == version_[w]; });
  });
  if (!due->ids.empty()) compute(due->slots, due->ids, Change::kNone);
}

class Simulation::DrawHooks final : public WorldHooks {
 public:
  DrawHooks(std::span<Sensor* const> sensors, DebugShapes& shapes)
      : sensors_(sensors), shapes_(shapes) {}
  void substep(const World& /*world*/) override {}
  void reset(const World& /*world*/) override {}
  void refreshed(const World& world) override {
    for (Sensor* sensor : sensors_) guarded(*sensor, [&] { sensor->draw(world, shapes_); });
  }

 private:
  std::span<Sensor* const> sensors_;
  DebugShapes& shapes_;
};

DebugShapes Simulation::draw(int world, std::span<Sensor* const> sensors) {
  std::vector<Sensor*> chosen(sensors.begin(), sensors.end());
  if (sensors.empty()) {
    for (auto& slot : slots_) {
      if (slot->sensor->debug_vis()) chosen.push_back(slot->sensor);
    }
  }
  const std::vector<int> ids = worlds_->checked_ids(std::span(&world, 1));
  DebugShapes shapes(model()->stat.meansize);
  if (chosen.empty()) return shapes;
  make_current(chosen, ids);
  DrawHooks hooks(chosen, shapes);
  worlds_->visit(ids, hooks);
  return shapes;
}

}  // namespace mjsense
