// SPDX-License-Identifier: Apache-2.0
// Height scan: 187 rays (1.6 x 1 m, 0.1 m apart) under the trunk of a quadruped, 64 worlds, on one
// thread; mjsense and mj_ray in one run. The robot has another pose in every scan, with other joint
// positions. items_per_second counts rays. MJSENSE_BENCH_QUADRUPED names an MJCF (such as a Go1's)
// to use instead of the stick figure.

#include <benchmark/benchmark.h>
#include <mujoco/mujoco.h>

#include <cmath>
#include <cstdlib>
#include <numeric>
#include <string>

#include "mjsense/core/rng.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"

namespace mjsense::sensors {
namespace {

constexpr int kWorlds = 64;
constexpr int kPoses = 2;  // of every world, in turn

std::string number(double x) { return std::to_string(x) + " "; }

// 128 x 128 points of hilly ground, 12.8 x 12.8 m.
std::string height_field() {
  std::string points;
  for (int r = 0; r < 128; ++r)
    for (int c = 0; c < 128; ++c)
      points += number(0.5 + 0.2 * std::sin(0.21 * r) + 0.2 * std::cos(0.17 * c) +
                       0.1 * std::sin(1.3 * r + 0.7 * c));
  return "<hfield name='ground' nrow='128' ncol='128' size='6.4 6.4 .5 .1' elevation='" + points +
         "'/>";
}

// 93 boxes of different heights on a plate.
std::string boxes() {
  Rng rng(3, 0, 0, 0);
  std::string geoms = "<geom type='box' size='8 8 .1' pos='0 0 -.1'/>";
  for (int i = 0; i < 93; ++i) {
    const double h = rng.uniform(0.02, 0.15);
    geoms += "<geom type='box' size='.4 .4 " + number(h) + "' pos='" +
             number(-3.6 + 0.8 * (i % 10)) + number(-3.6 + 0.8 * (i / 10)) + number(h) + "'/>";
  }
  return geoms;
}

std::string stick_figure() {
  std::string legs;
  for (const char* at : {".2 .1 0", ".2 -.1 0", "-.2 .1 0", "-.2 -.1 0"})
    legs += std::string("<body pos='") + at +
            "'><joint type='hinge' axis='0 1 0'/><geom type='capsule' size='.02' fromto='0 0 0 .1 "
            "0 -.2'/>" +
            "<body pos='.1 0 -.2'><joint type='hinge' axis='0 1 0'/><geom type='capsule' "
            "size='.015' fromto='0 0 0 -.1 0 -.2'/>" +
            "<geom type='sphere' size='.02' pos='-.1 0 -.2'/></body></body>";
  return "<body name='trunk' pos='0 0 1'><freejoint/><geom type='box' size='.2 .1 .05' mass='6'/>" +
         legs + "</body>";
}

mjModel* load(bool field) {
  char error[500] = "";
  const char* file = std::getenv("MJSENSE_BENCH_QUADRUPED");
  const std::string world = "<mujoco><asset>" + (field ? height_field() : "") +
                            "</asset><worldbody>" +
                            (field ? "<geom type='hfield' hfield='ground'/>" : boxes()) +
                            (file ? "" : stick_figure()) + "</worldbody></mujoco>";
  mjSpec* spec = mj_parseXMLString(world.c_str(), nullptr, error, sizeof error);
  if (file != nullptr) {
    mjSpec* robot = mj_parseXML(file, nullptr, error, sizeof error);
    mjsBody* trunk = mjs_asBody(mjs_firstChild(mjs_findBody(robot, "world"), mjOBJ_BODY, 0));
    mjs_setString(mjs_getName(trunk->element), "trunk");
    trunk->pos[2] = 1;
    mjs_attach(mjs_addFrame(mjs_findBody(spec, "world"), nullptr)->element, trunk->element, "", "");
  }
  mjModel* m = mj_compile(spec, nullptr);
  if (m == nullptr) std::fprintf(stderr, "%s\n", mjs_getError(spec));
  // Saves the scene for the benchmarks of other libraries in Python (bench/peers).
  if (const char* path = std::getenv("MJSENSE_BENCH_SAVE")) mj_saveModel(m, path, nullptr, 0);
  return m;
}

struct Fixture {
  mjModel* m;
  std::vector<mjData*> d;  // [kPoses, kWorlds]
  RayCastSensorCfg cfg;
  std::unique_ptr<RayCastSensor> sensor;
  std::unique_ptr<rays::RayScene> rays;
  std::vector<int> ids = std::vector<int>(kWorlds);

  explicit Fixture(bool field, int threads = 1) : m(load(field)) {
    Rng rng(1, 0, 0, 0);
    for (int i = 0; i < kPoses * kWorlds; ++i) {
      d.push_back(mj_makeData(m));
      double* q = d[i]->qpos;
      q[0] = rng.uniform(-3, 3);
      q[1] = rng.uniform(-3, 3);
      q[2] = 1.0;
      const double yaw = rng.uniform(-3, 3), tilt = rng.uniform(-0.1, 0.1);
      q[3] = std::cos(yaw / 2);
      q[4] = tilt;
      q[6] = std::sin(yaw / 2);
      mju_normalize4(q + 3);
      for (int j = 7; j < m->nq; ++j) q[j] += rng.uniform(-0.2, 0.2);
      mj_forward(m, d[i]);
    }
    cfg.name = "scan";
    cfg.frame = {{"body", "trunk", ""}};
    cfg.pattern = GridPattern{.size = {1.6, 1.0}};
    cfg.ray_alignment = "yaw";
    sensor = std::make_unique<RayCastSensor>(cfg);
    sensor->initialize({.model = m, .num_worlds = kWorlds, .threads = threads});
    rays = std::make_unique<rays::RayScene>(m, kWorlds);
    std::iota(ids.begin(), ids.end(), 0);
  }
  ~Fixture() {
    for (mjData* x : d) mj_deleteData(x);
    mj_deleteModel(m);
  }
  // A world with its pose in this scan.
  World world(int w, int scan) {
    World world;
    world.id = w;
    world.model = m;
    world.data = d[scan % kPoses * kWorlds + w];
    return world;
  }
};

void height_scan(benchmark::State& state, bool field) {
  Fixture f(field, static_cast<int>(state.range(0)));
  ThreadPool pool(static_cast<int>(state.range(0)));
  int scan = 0;
  for (auto _ : state) {
    pool.run(kWorlds, [&](int w, int) {
      f.rays->update(f.world(w, scan));
      f.sensor->compute(f.world(w, scan));
    });
    ++scan;
    f.sensor->cast({f.rays.get(), f.ids, pool});
  }
  state.SetItemsProcessed(state.iterations() * kWorlds * f.sensor->num_rays());
}

void height_scan_mj_ray(benchmark::State& state, bool field) {
  Fixture f(field);
  const mjtByte groups[6] = {1, 1, 1, 0, 0, 0};
  const RayPattern& pattern = f.sensor->pattern();
  int w = 0;
  for (auto _ : state) {
    FramePose pose =
        RayFrame(f.m, nullptr, f.cfg.frame[0], "bench").pose(f.d[w], RayAlignment::kYaw);
    for (std::size_t i = 0; i < pattern.size(); ++i) {
      double o[3], d[3] = {0, 0, -1}, n[3];
      for (int k = 0; k < 3; ++k)
        o[k] = pose.pos[k] + pose.align[3 * k] * pattern.offsets[i][0] +
               pose.align[3 * k + 1] * pattern.offsets[i][1];
      int geom;
      benchmark::DoNotOptimize(mj_ray(f.m, f.d[w], o, d, groups, 1, 1, &geom, n));
    }
    w = (w + 1) % (kPoses * kWorlds);
  }
  state.SetItemsProcessed(state.iterations() * pattern.size());
}

// Cost of updating the ray scene before the first ray is cast, for a robot that moves and for one
// that does not.
void top_level(benchmark::State& state, bool moving) {
  Fixture f(false);
  int w = 0, scan = 0;
  for (auto _ : state) {
    f.rays->update(f.world(w, scan));
    w = (w + 1) % kWorlds;
    if (moving && w == 0) ++scan;
  }
  state.counters["geoms"] = static_cast<double>(f.m->ngeom);
}

BENCHMARK_CAPTURE(height_scan, height_field, true)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK_CAPTURE(height_scan_mj_ray, height_field, true);
BENCHMARK_CAPTURE(height_scan, boxes, false)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK_CAPTURE(height_scan_mj_ray, boxes, false);
BENCHMARK_CAPTURE(top_level, moving, true);
BENCHMARK_CAPTURE(top_level, still, false);

}  // namespace
}  // namespace mjsense::sensors
