// SPDX-License-Identifier: Apache-2.0
// Cost of many geoms: a lidar of 5,760 rays among boxes on a floor. The number of boxes per square
// metre is constant, and one more box moves. Updating the scene is also timed. For comparison: all
// fixed boxes as one mesh, whose BVH is built once, and MuJoCo's rays. items_per_second is rays per
// second.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <iterator>
#include <numbers>
#include <string>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/core/sensor.h"
#include "mjsense/core/testing/test_model.h"
#include "mjsense/rays/ray_scene.h"

namespace mjsense::rays {
namespace {

constexpr double kHalf[] = {0.1, 0.1, 0.2};  // half sizes of a box, m

void add_box(double x, double y, int index, std::string& vertices, std::string& faces) {
  for (int i = 0; i < 8; ++i) {
    fmt::format_to(std::back_inserter(vertices), "{} {} {} ", x + (i & 1 ? kHalf[0] : -kHalf[0]),
                   y + (i & 2 ? kHalf[1] : -kHalf[1]), i & 4 ? 2 * kHalf[2] : 0);
  }
  for (const int v : {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                      2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5}) {
    fmt::format_to(std::back_inserter(faces), "{} ", 8 * index + v);
  }
}

std::string field(int count, bool one_mesh) {
  Rng rng(1, 0, 0, 0);
  const double side = 0.5 * std::sqrt(count);  // half size of the floor, m
  std::string boxes, vertices, faces;
  for (int i = 0; i < count; ++i) {
    const double x = rng.uniform(-side, side), y = rng.uniform(-side, side);
    boxes += fmt::format("<geom type='box' size='{} {} {}' pos='{} {} {}'/>", kHalf[0], kHalf[1],
                         kHalf[2], x, y, kHalf[2]);
    add_box(x, y, i, vertices, faces);
  }
  const std::string mesh = fmt::format(
      "<asset><mesh name='all' inertia='shell' vertex='{}' face='{}'/></asset>", vertices, faces);
  return fmt::format(
      "<mujoco>{}<worldbody><geom type='plane' size='0 0 1'/>"
      "<body pos='1 0 .5'><freejoint/><geom type='box' size='.1 .1 "
      ".1'/></body>{}</worldbody></mujoco>",
      one_mesh ? mesh : "", one_mesh ? "<geom type='mesh' mesh='all'/>" : boxes);
}

struct Field {
  ModelPtr owned_model;
  DataPtr owned_data = make_data(owned_model.get());
  mjModel* model = owned_model.get();
  mjData* data = owned_data.get();
  std::vector<double> directions;  // [5760, 3]

  explicit Field(int count, bool one_mesh = false)
      : owned_model(compile_mjcf(field(count, one_mesh))) {
    for (int p = 0; p < 360; ++p) {
      for (int i = 0; i < kPacket; ++i) {
        const double azimuth = p * std::numbers::pi / 180, elevation = 0.03 * i - 0.3;
        directions.insert(directions.end(),
                          {std::cos(azimuth) * std::cos(elevation),
                           std::sin(azimuth) * std::cos(elevation), std::sin(elevation)});
      }
    }
  }
  int num_rays() const { return static_cast<int>(directions.size() / 3); }
  // Moves the moving box and computes the poses. Not timed, since a simulation computes them
  // anyway.
  void move(benchmark::State& state) {
    state.PauseTiming();
    data->qpos[1] = data->qpos[1] == 0 ? 0.1 : 0;
    mj_kinematics(model, data);
    state.ResumeTiming();
  }
};

void cast(benchmark::State& state, Field& f) {
  RayScene scene(f.model, 1);
  RayScratch scratch(scene.num_objects());
  std::vector<RayPacket> packets(f.num_rays() / kPacket);
  for (std::size_t p = 0; p < packets.size(); ++p) {
    packets[p] = {};
    packets[p].origin[2] = 0.8;
    for (int i = 0; i < kPacket; ++i) {
      for (int c = 0; c < 3; ++c)
        packets[p].d[c][i] = static_cast<float>(f.directions[3 * (p * kPacket + i) + c]);
      packets[p].tmax[i] = 100;
    }
  }
  HitPacket hits;
  for (auto _ : state) {
    f.move(state);
    scene.update({.id = 0, .model = f.model, .data = f.data});
    for (const RayPacket& rays : packets) {
      scene.trace(0, {}, rays, hits, scratch);
      benchmark::DoNotOptimize(hits);
    }
  }
  state.SetItemsProcessed(state.iterations() * f.num_rays());
}

void among_boxes(benchmark::State& state) {
  Field f(static_cast<int>(state.range(0)));
  cast(state, f);
}

void among_boxes_of_one_mesh(benchmark::State& state) {
  Field f(static_cast<int>(state.range(0)), true);
  cast(state, f);
}

void among_boxes_update(benchmark::State& state) {
  Field f(static_cast<int>(state.range(0)));
  RayScene scene(f.model, 1);
  for (auto _ : state) {
    f.move(state);
    scene.update({.id = 0, .model = f.model, .data = f.data});
  }
}

void among_boxes_mj_multiRay(benchmark::State& state) {
  Field f(static_cast<int>(state.range(0)));
  const double origin[] = {0, 0, 0.8};
  std::vector<double> distance(f.num_rays());
  std::vector<int> geoms(f.num_rays());
  for (auto _ : state) {
    f.move(state);
    mj_multiRay(f.model, f.data, origin, f.directions.data(), nullptr, 1, -1, geoms.data(),
                distance.data(), nullptr, f.num_rays(), 100);
  }
  state.SetItemsProcessed(state.iterations() * f.num_rays());
}

BENCHMARK(among_boxes)->Arg(100)->Arg(1000)->Arg(10000);
BENCHMARK(among_boxes_of_one_mesh)->Arg(100)->Arg(1000)->Arg(10000);
BENCHMARK(among_boxes_update)->Arg(100)->Arg(1000)->Arg(10000);
BENCHMARK(among_boxes_mj_multiRay)->Arg(100)->Arg(1000)->Arg(10000);

}  // namespace
}  // namespace mjsense::rays
