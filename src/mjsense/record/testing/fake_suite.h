// SPDX-License-Identifier: Apache-2.0
#pragma once
// A suite without physics that has the streams of a Franka pick. Every value is a function of
// (episode, step), so that tests and benchmarks know which values must be on disk.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::record {

struct FakeSuiteCfg {
  int num_worlds = 1;
  int width = 64, height = 48;
  bool rgb = true, depth = true;
  int cameras = 1;  // names: wrist_camera, exo_camera_1, ...
};

class FakeSuite {
 public:
  explicit FakeSuite(const FakeSuiteCfg& cfg);
  ~FakeSuite();
  std::vector<const Sensor*> sensors() const;
  Sensor& sensor(const std::string& name);
  // Writes step `t` of `episode`, which has `length` steps, into row `world` of every sensor.
  void fill(int world, std::int64_t episode, int t, int length);

  static float joint(std::int64_t episode, int t, int j);  // rad
  // m; 0 in the upper left corner, infinite in the upper right one
  static float depth(int x, int y, int t);
  static std::string obs_scene(std::int64_t episode);

 private:
  struct Cfg;
  FakeSuiteCfg cfg_;
  std::vector<std::unique_ptr<Sensor>> sensors_;
};

}  // namespace mjsense::record
