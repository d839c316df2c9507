// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a recording stores so that its episodes can be simulated again: the complete state of every
// step, and everything that was written into the simulation between two steps.

#include <span>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::tasks::rollout {

// Streams, for observation t:
//   replay/state    float64 [nstate]  MuJoCo's mjSTATE_INTEGRATION at observation t
//   replay/written  float64 [nstate]  values that were written into state t-1 before the physics
//                                     step that led to observation t (controls, mocap poses, pushes);
//                                     NaN where nothing was written. All NaN at observation 0
//   replay/ctrl     float64 [ticks, nu]          controls of each control tick of that step, and
//   replay/mocap    float64 [ticks, nmocap, 7]   mocap poses (m, wxyz). Only for robots whose
//                                                controllers run several times a step; NaN at 0
class ReplaySensor final : public Sensor {
 public:
  // ticks: how often controllers run in a step.
  ReplaySensor(worlds::Worlds& worlds, int ticks);
  std::string_view kind() const override { return "replay"; }
  void initialize(const SensorInit& init) override;
  mjtStage needs() const override { return mjSTAGE_NONE; }
  void compute(const World& world) override;
  void reset(const World& world) override;

  // Call before the physics step, after all controls are written.
  void note_written(std::span<const int> worlds);
  // Call at control tick `tick` of a step, after the controllers. Returns whether controls were
  // replaced (see play()).
  bool note_tick(const World& world, int tick);

  // From now on note_tick() replaces the controls and mocap poses of this world by recorded ones
  // before it stores them. The rows must stay valid until the next call; empty rows replace nothing.
  void play(int world, std::span<const double> ctrl, std::span<const double> mocap);

 private:
  struct Played {
    std::span<const double> ctrl, mocap;
  };
  worlds::Worlds& worlds_;
  int ticks_;
  std::vector<Played> played_;
  Field *state_ = nullptr, *written_ = nullptr, *ctrl_ = nullptr, *mocap_ = nullptr;
};

}  // namespace mjsense::tasks::rollout
