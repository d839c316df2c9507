// SPDX-License-Identifier: Apache-2.0
// Spinning lidar, 16 x 360 rays from the head of a humanoid, on one thread. One run measures
// mjsense, mj_multiRay and mj_ray; the robot has another pose in every scan. Other benchmarks scan
// many worlds, with a physics step between scans. items_per_second counts rays.
// MJSENSE_BENCH_HUMANOID names an MJCF (such as a G1's) to use instead of the built-in stand-in. It
// needs a body that can carry the lidar: MJSENSE_BENCH_HUMANOID_BODY, default torso_link.

#include <benchmark/benchmark.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/sensors/lidar/lidar_sensor.h"

namespace mjsense::sensors {
namespace {

std::string number(double x) { return std::to_string(x) + " "; }

// 43 meshes, each a bumpy ball of about 9,000 faces.
std::string meshes() {
  std::string xml;
  for (int i = 0; i < 43; ++i) {
    std::string points, faces;
    constexpr int kRows = 48, kColumns = 96;
    for (int r = 0; r <= kRows; ++r)
      for (int c = 0; c < kColumns; ++c) {
        const double a = mjPI * r / kRows, b = 2 * mjPI * c / kColumns;
        const double s = 0.06 * (1 + 0.1 * std::sin(5 * a + i) * std::cos(7 * b));
        points += number(s * std::sin(a) * std::cos(b)) + number(s * std::sin(a) * std::sin(b)) +
                  number(1.5 * s * std::cos(a));
      }
    for (int r = 0; r < kRows; ++r)
      for (int c = 0; c < kColumns; ++c) {
        const int p = r * kColumns + c, q = r * kColumns + (c + 1) % kColumns;
        for (int v : {p, p + kColumns, q, q, p + kColumns, q + kColumns})
          faces += std::to_string(v) + " ";
      }
    xml += "<mesh name='m" + std::to_string(i) + "' inertia='shell' vertex='" + points +
           "' face='" + faces + "'/>";
  }
  return xml;
}

std::string stand_in() {
  std::string xml =
      "<body name='torso_link' pos='0 0 1'><freejoint/><geom type='sphere' size='.05' "
      "mass='1'/><site name='head' pos='0 0 .4'/>";
  for (int i = 0; i < 43; ++i)
    xml += "<geom type='mesh' mesh='m" + std::to_string(i) + "' pos='" +
           number(0.15 * std::cos(i)) + number(0.3 * std::sin(i)) + number(0.3 - 0.03 * i) + "'/>";
  return xml + "</body>";
}

// A room: a floor and 58 boxes, capsules and cylinders.
std::string room() {
  Rng rng(5, 0, 0, 0);
  std::string xml = "<geom type='plane' size='0 0 .1'/>";
  for (int i = 0; i < 58; ++i) {
    const double angle = rng.uniform(-3.14, 3.14), far = rng.uniform(1.5, 12);
    const char* types[] = {"box", "capsule", "cylinder"};
    xml += std::string("<geom type='") + types[i % 3] + "' size='" + number(rng.uniform(0.1, 0.6)) +
           number(rng.uniform(0.1, 0.6)) + number(rng.uniform(0.2, 1.5)) + "' pos='" +
           number(far * std::cos(angle)) + number(far * std::sin(angle)) + "0.7'/>";
  }
  return xml;
}

mjModel* load() {
  char error[500] = "";
  const char* file = std::getenv("MJSENSE_BENCH_HUMANOID");
  const std::string world = "<mujoco><asset>" + (file ? "" : meshes()) + "</asset><worldbody>" +
                            room() + (file ? "" : stand_in()) + "</worldbody></mujoco>";
  mjSpec* spec = mj_parseXMLString(world.c_str(), nullptr, error, sizeof error);
  if (file != nullptr) {
    mjSpec* robot = mj_parseXML(file, nullptr, error, sizeof error);
    const char* body = std::getenv("MJSENSE_BENCH_HUMANOID_BODY");
    mjsSite* site = mjs_addSite(mjs_findBody(robot, body ? body : "torso_link"), nullptr);
    mjs_setName(site->element, "head");
    site->pos[2] = 0.45;
    mjsBody* root = mjs_asBody(mjs_firstChild(mjs_findBody(robot, "world"), mjOBJ_BODY, 0));
    mjs_attach(mjs_addFrame(mjs_findBody(spec, "world"), nullptr)->element, root->element, "", "");
  }
  mjModel* m = spec ? mj_compile(spec, nullptr) : nullptr;
  if (m == nullptr) std::fprintf(stderr, "%s %s\n", error, spec ? mjs_getError(spec) : "");
  return m;
}

struct Fixture {
  mjModel* m = load();
  mjData* d;                 // pose in this scan
  std::vector<mjData*> all;  // one per world, at least two; their joint positions differ too
  std::unique_ptr<LidarSensor> sensor;
  std::unique_ptr<rays::RayScene> rays;

  explicit Fixture(int threads = 1, int worlds = 1) {
    // Saves the scene for the benchmarks of other libraries in Python (bench/peers).
    if (const char* path = std::getenv("MJSENSE_BENCH_SAVE")) mj_saveModel(m, path, nullptr, 0);
    Rng rng(6, 0, 0, 0);
    for (int i = 0; i < std::max(2, worlds); ++i) {
      d = all.emplace_back(mj_makeData(m));
      for (int j = 7; i > 0 && j < m->nq; ++j) d->qpos[j] += rng.uniform(-0.2, 0.2);
      mj_forward(m, d);
    }
    d = all[0];
    LidarSensorCfg cfg;
    cfg.name = "lidar";
    cfg.frame = {{"site", "head", ""}};
    cfg.include_geom_groups = std::nullopt;
    cfg.max_distance = 30;
    sensor = std::make_unique<LidarSensor>(cfg);
    sensor->initialize({.model = m, .num_worlds = worlds, .threads = threads});
    rays = std::make_unique<rays::RayScene>(m, worlds);
  }
  ~Fixture() {
    for (mjData* x : all) mj_deleteData(x);
    mj_deleteModel(m);
  }
  void next() { d = d == all[0] ? all[1] : all[0]; }
  int body() const { return m->site_bodyid[mj_name2id(m, mjOBJ_SITE, "head")]; }
  const double* head() const { return d->site_xpos + 3 * mj_name2id(m, mjOBJ_SITE, "head"); }
};

void lidar(benchmark::State& state) {
  Fixture f(static_cast<int>(state.range(0)));
  ThreadPool pool(static_cast<int>(state.range(0)));
  World world;
  world.model = f.m;
  const int ids[] = {0};
  for (auto _ : state) {
    f.next();
    world.data = f.d;
    f.rays->update(world);
    f.sensor->compute(world);
    f.sensor->cast({f.rays.get(), ids, pool});
  }
  state.SetItemsProcessed(state.iterations() * f.sensor->num_rays());
  state.counters["geoms"] = static_cast<double>(f.m->ngeom);
  state.counters["faces"] = static_cast<double>(f.m->nmeshface);
  int hits = 0;
  for (float t : f.sensor->field("distances").data.all<float>()) hits += t >= 0;
  state.counters["hits"] = hits;
}

void lidar_mj_multiRay(benchmark::State& state) {
  Fixture f;
  const RayPattern& p = f.sensor->pattern();
  std::vector<double> distance(p.size()), normals(3 * p.size());
  std::vector<int> geoms(p.size());
  for (auto _ : state) {
    f.next();
    mj_multiRay(f.m, f.d, f.head(), p.directions[0].data(), nullptr, 1, f.body(), geoms.data(),
                distance.data(), normals.data(), static_cast<int>(p.size()), 30);
  }
  state.SetItemsProcessed(state.iterations() * p.size());
}

void lidar_mj_ray(benchmark::State& state) {
  Fixture f;
  const RayPattern& p = f.sensor->pattern();
  for (auto _ : state) {
    f.next();
    for (const auto& d : p.directions) {
      int geom;
      double normal[3];
      benchmark::DoNotOptimize(
          mj_ray(f.m, f.d, f.head(), d.data(), nullptr, 1, f.body(), &geom, normal));
    }
  }
  state.SetItemsProcessed(state.iterations() * p.size());
}

// There is physics between the scans. It is not timed, but it evicts the scan's data from the
// caches.
constexpr int kWorlds = 16;

void lidar_worlds(benchmark::State& state) {
  Fixture f(1, kWorlds);
  ThreadPool pool(1);
  std::vector<int> ids(kWorlds);
  std::iota(ids.begin(), ids.end(), 0);
  for (auto _ : state) {
    state.PauseTiming();
    for (mjData* d : f.all) mj_step(f.m, d);
    for (mjData* d : f.all) mj_kinematics(f.m, d);
    state.ResumeTiming();
    for (int w : ids) {
      World world;
      world.id = w;
      world.model = f.m;
      world.data = f.all[w];
      f.rays->update(world);
      f.sensor->compute(world);
    }
    f.sensor->cast({f.rays.get(), ids, pool});
  }
  state.SetItemsProcessed(state.iterations() * kWorlds * f.sensor->num_rays());
}

void lidar_worlds_mj_multiRay(benchmark::State& state) {
  Fixture f(1, kWorlds);
  const RayPattern& p = f.sensor->pattern();
  std::vector<double> distance(p.size()), normals(3 * p.size());
  std::vector<int> geoms(p.size());
  for (auto _ : state) {
    state.PauseTiming();
    for (mjData* d : f.all) mj_step(f.m, d);
    for (mjData* d : f.all) mj_kinematics(f.m, d);
    state.ResumeTiming();
    for (mjData* d : f.all) {
      f.d = d;
      mj_multiRay(f.m, d, f.head(), p.directions[0].data(), nullptr, 1, f.body(), geoms.data(),
                  distance.data(), normals.data(), static_cast<int>(p.size()), 30);
    }
  }
  state.SetItemsProcessed(state.iterations() * kWorlds * p.size());
}

BENCHMARK(lidar)->Arg(1)->Arg(2)->UseRealTime();
BENCHMARK(lidar_mj_multiRay);
BENCHMARK(lidar_mj_ray);
BENCHMARK(lidar_worlds);
BENCHMARK(lidar_worlds_mj_multiRay);

}  // namespace
}  // namespace mjsense::sensors
