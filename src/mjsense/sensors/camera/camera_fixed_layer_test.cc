// SPDX-License-Identifier: Apache-2.0
// A camera that has stored a layer of the fixed geoms makes the same image as one that has not, bit
// for bit.

#include <gtest/gtest.h>

#include <functional>
#include <string>
#include <vector>

#include "mjsense/core/system/thread_pool.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/camera_sensor.h"

namespace mjsense::sensors {
namespace {

std::string room(Rng& rng) {
  std::string heights;
  for (int i = 0; i < 30 * 30; ++i) heights += testing::vec({rng.uniform()});
  std::string things;
  for (int i = 0; i < 12; ++i) {
    const std::string pos =
        testing::vec({rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.2, 1)});
    const std::string body =
        i % 3 == 0 ? "<body pos='" + pos + "'>" : "<body pos='" + pos + "'><freejoint/>";
    things += body + "<geom type='mesh' mesh='rock'/><geom type='box' size='.1 .2 .05'/>" +
              (i % 4 == 0 ? "<geom type='sphere' size='.15' pos='.2 0 0' rgba='1 0 0 .5'/>" : "") +
              "</body>";
  }
  std::string rock;
  for (int i = 0; i < 60; ++i)
    rock += testing::vec({rng.uniform(-0.3, 0.3), rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2)});
  return "<mujoco><asset><mesh name='rock' vertex='" + rock +
         "'/><hfield name='ground' nrow='30' ncol='30' size='2 2 .3 .1' elevation='" + heights +
         "'/></asset><worldbody><light name='sun' pos='0 0 4' dir='.3 .2 -1' type='directional'/>"
         "<light name='lamp' pos='1 -1 3' dir='-.3 .3 -1' cutoff='60'/>"
         "<geom name='floor' type='plane' size='0 0 1'/><geom type='hfield' hfield='ground'/>" +
         things +
         "<body name='marker' mocap='true' pos='0 0 1'><geom type='box' size='.2 .2 .02'/></body>"
         "<body name='base' mocap='true' pos='-1 0 .5'><geom type='cylinder' size='.1 .5'/>"
         "<body pos='0 0 .6'><geom type='mesh' mesh='rock'/></body></body>"
         "<camera name='c' pos='0 -2.5 3' euler='40 0 0' fovy='50'/></worldbody></mujoco>";
}

struct Camera {
  std::unique_ptr<Sensor> sensor;
  explicit Camera(const mjModel* model, int num_worlds = 1, int threads = 1, bool shadows = true,
                  bool physical = false) {
    CameraSensorCfg cfg;
    cfg.name = "cam";
    cfg.camera_name = "c";
    cfg.width = 75;
    cfg.height = 50;
    cfg.data_types = {"rgb", "depth", "segmentation", "normals"};
    cfg.use_shadows = shadows;
    if (physical) cfg.shading = "pbr";
    sensor = cfg.build();
    SensorInit init;
    init.model = model;
    init.num_worlds = num_worlds;
    init.threads = threads;
    sensor->initialize(init);
  }
};

// All bytes of a world's image.
std::vector<std::uint8_t> bytes_of(Camera& camera, int world) {
  std::vector<std::uint8_t> bytes;
  for (const char* field : {"rgb", "depth", "segmentation", "normals"}) {
    const Array& data = camera.sensor->field(field).data;
    const auto* p = reinterpret_cast<const std::uint8_t*>(data.row_data(world));
    bytes.insert(bytes.end(), p, p + data.row_bytes());
  }
  return bytes;
}

// Renders world 0 and returns its image.
std::vector<std::uint8_t> image(Camera& camera, const TestModel& m, rays::RayScene& rays,
                                ThreadPool& pool) {
  mj_forward(m.model, m.data);
  rays.update(m.world());
  camera.sensor->compute(m.world());
  const int id = 0;
  camera.sensor->cast({&rays, {&id, 1}, pool});
  return bytes_of(camera, id);
}

TEST(FixedLayer, DoesNotChangeImages) {
  for (int scene = 0; scene < 7; ++scene) {
    const bool physical = scene >= 4;
    Rng rng(5, 0, 1, scene);
    TestModel m(room(rng));
    rays::RayScene rays(m.model, 1);
    ThreadPool pool(1 + scene % 3);
    const bool shadows = scene != 3;
    Camera keeps(m.model, 1, 1 + scene % 3, shadows, physical);
    const int box = m.model->ngeom - 3, light = 1;
    const std::vector<std::function<void()>> changes = {
        [] {},
        [] {},
        [] {},
        [&] { m.data->qpos[0] += 0.3; },
        [&] { m.data->mocap_pos[0] += 0.1; },
        [&] { m.data->mocap_pos[3] += 0.1; },
        [] {},
        [] {},
        // A fixed geom changes, so that the stored layer is invalid.
        [&] { m.model->geom_pos[3 * 2] += 0.2; },
        [] {},
        [] {},
        [] {},
        [&] { m.model->light_pos[3 * light] += 0.5; },
        [] {},
        [] {},
        [&] { m.model->cam_fovy[0] += 5; },
        [] {},
        [] {},
        [&] { m.model->geom_rgba[4 * box + 3] = 0; },
        [&] { m.model->geom_rgba[4] = 0.2f; },
        [] {},
        [] {},
        [&] { m.data->qpos[7] -= 0.2; },
    };
    for (std::size_t i = 0; i < changes.size(); ++i) {
      changes[i]();
      Camera fresh(m.model, 1, 1 + scene % 3, shadows, physical);
      EXPECT_EQ(image(keeps, m, rays, pool), image(fresh, m, rays, pool))
          << "scene " << scene << " image " << i;
    }
  }
}

// Worlds with different lights, floors and cameras store a layer each, with one and with several
// threads, whichever worlds are rendered.
TEST(FixedLayer, DifferentWorldsHaveTheirOwnLayers) {
  constexpr int kWorlds = 6;
  const std::vector<std::vector<int>> casts = {
      {0, 1, 2, 3, 4, 5}, {0, 1, 2, 3, 4, 5}, {0, 1, 2, 3, 4, 5}, {4}, {0, 1, 2, 3, 4, 5}, {1, 4},
      {0, 1, 2, 3, 4, 5}};
  for (int threads : {1, 3}) {
    std::vector<std::unique_ptr<TestModel>> worlds;
    for (int i = 0; i < kWorlds; ++i) {
      Rng rng(5, 0, 1, 0);
      worlds.push_back(std::make_unique<TestModel>(room(rng)));
      mjModel* m = worlds.back()->model;
      m->light_pos[3] += 0.2 * i;
      m->cam_pos[0] += 0.1 * i;
      m->geom_rgba[0] = 0.1f * i;
    }
    rays::RayScene rays(worlds[0]->model, kWorlds);
    ThreadPool pool(threads);
    Camera keeps(worlds[0]->model, kWorlds, threads);
    for (std::size_t i = 0; i < casts.size(); ++i) {
      Camera fresh(worlds[0]->model, kWorlds, threads);
      for (int id : casts[i]) {
        TestModel& m = *worlds[id];
        m.data->qpos[0] += 0.05;
        if (i == 3) m.model->light_pos[4] += 0.3;  // an episode begins
        mj_forward(m.model, m.data);
        rays.update(m.world(id));
        keeps.sensor->compute(m.world(id));
        fresh.sensor->compute(m.world(id));
      }
      keeps.sensor->cast({&rays, casts[i], pool});
      fresh.sensor->cast({&rays, casts[i], pool});
      for (int id : casts[i])
        EXPECT_EQ(bytes_of(keeps, id), bytes_of(fresh, id)) << "cast " << i << " world " << id;
    }
  }
}

}  // namespace
}  // namespace mjsense::sensors
