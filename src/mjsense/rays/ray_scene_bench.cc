// SPDX-License-Identifier: Apache-2.0
// What many geoms cost: a lidar of 5,760 rays among boxes that stand on a floor, as many to a square
// metre whatever their number.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"
#include "mjsense/rays/ray_scene.h"

namespace mjsense {
namespace {

std::string boxes(int count) {
  Rng rng(1, 0, 0, 0);
  const double half = 0.5 * std::sqrt(count);  // m, of the floor
  std::string xml = "<mujoco><worldbody><geom type='plane' size='0 0 1'/>";
  for (int i = 0; i < count; ++i) {
    xml += fmt::format("<geom type='box' size='.1 .1 .2' pos='{} {} .2'/>",
                       rng.uniform(-half, half), rng.uniform(-half, half));
  }
  return xml + "</worldbody></mujoco>";
}

void lidar_among_boxes(benchmark::State& state) {
  mjSpec* spec =
      mj_parseXMLString(boxes(static_cast<int>(state.range(0))).c_str(), nullptr, nullptr, 0);
  mjModel* model = mj_compile(spec, nullptr);
  mjData* data = mj_makeData(model);
  mj_kinematics(model, data);
  RayScene scene(model, 1);
  scene.update({.id = 0, .model = model, .data = data});
  RayScratch scratch(scene.num_objects());
  std::vector<RayPacket> packets(360);
  for (int p = 0; p < 360; ++p) {
    packets[p] = {};
    packets[p].origin[2] = 0.8;
    for (int i = 0; i < kPacket; ++i) {
      const double azimuth = p * std::numbers::pi / 180, elevation = 0.03 * i - 0.3;
      packets[p].d[0][i] = static_cast<float>(std::cos(azimuth) * std::cos(elevation));
      packets[p].d[1][i] = static_cast<float>(std::sin(azimuth) * std::cos(elevation));
      packets[p].d[2][i] = static_cast<float>(std::sin(elevation));
      packets[p].tmax[i] = 100;
    }
  }
  HitPacket hits;
  for (auto _ : state) {
    for (const RayPacket& rays : packets) {
      scene.trace(0, {}, rays, hits, scratch);
      benchmark::DoNotOptimize(hits);
    }
  }
  state.SetItemsProcessed(state.iterations() * 360 * kPacket);
  mj_deleteData(data);
  mj_deleteModel(model);
  mj_deleteSpec(spec);
}
BENCHMARK(lidar_among_boxes)->Arg(100)->Arg(300)->Arg(1000)->Arg(10000);

}  // namespace
}  // namespace mjsense
