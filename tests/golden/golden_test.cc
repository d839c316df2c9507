// SPDX-License-Identifier: Apache-2.0
// Regression test of exact results. Plays five scenes and compares hashes of the states, of every
// sensor's rows and of the images with a file. README.md explains differences and how to renew the
// file.
//
//   golden_test [FILE]      compares; 0 equal, 1 different, 77 no hashes for this CPU
//   golden_test --print     prints this CPU's lines, with the kernels that MJSENSE_ISA names
//   golden_test --values FILE  writes what is hashed, for compare.py

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <map>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/system/cpu.h"
#include "mjsense/effects/calibration.h"
#include "mjsense/effects/effect_sensor.h"
#include "mjsense/effects/noise.h"
#include "mjsense/effects/timing.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/builtin/builtin_sensor.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense/sensors/contact/contact_sensor.h"
#include "mjsense/sensors/imu/imu_sensor.h"
#include "mjsense/sensors/lidar/lidar_sensor.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"
#include "mjsense/sensors/terrain_height/terrain_height_sensor.h"
#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense {
namespace {

bool keep_values = false;

// FNV-1a, 64 bits, of rows. Has the rows themselves if they are kept.
class Hash {
 public:
  void add(DType dtype, const void* data, std::size_t bytes) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) value_ = (value_ ^ p[i]) * 0x100000001b3ull;
    if (!keep_values) return;
    dtype_ = dtype;
    rows_.append(static_cast<const char*>(data), bytes);
  }
  std::string text() const { return fmt::format("{:016x}", value_); }
  DType dtype() const { return dtype_; }
  const std::string& rows() const { return rows_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ull;
  DType dtype_ = DType::kFloat64;
  std::string rows_;
};

using Hashes = std::map<std::string, Hash>;  // by "state" or "sensor field"

void add_state(sim::Simulation& sim, Hashes& out) {
  const ArrayView state = sim.worlds().state();
  out["state"].add(DType::kFloat64, state.data, state.bytes());
}

void add_rows(const Sensor& sensor, Hashes& out) {
  for (const Field& f : sensor.fields())
    out[sensor.name() + (f.name.empty() ? "" : "/" + f.name)].add(f.spec.dtype, f.data.data(),
                                                                  f.data.bytes());
}

template <class Cfg, class Fill>
void add(scene::SceneCfg& scene, const char* name, Fill&& fill) {
  auto cfg = std::make_shared<Cfg>();
  cfg->name = name;
  fill(*cfg);
  scene.sensors.push_back(std::move(cfg));
}

void add_entity(scene::SceneCfg& scene, const char* name, const char* xml,
                std::array<double, 3> pos = {}) {
  scene::EntityCfg entity;
  entity.model.xml = xml;
  entity.pos = pos;
  scene.entities.emplace_back(name, entity);
}

// Plays worlds with different starts and controls. One world is reset halfway.
Hashes play(scene::SceneCfg cfg, int steps) {
  constexpr int kWorlds = 3;
  sim::Simulation sim(std::make_shared<scene::Scene>(std::move(cfg)),
                      {.num_worlds = kWorlds, .decimation = 4, .threads = 2, .seed = 11});
  const mjModel* m = sim.model();
  const auto row = [&](const char* component, int w) {
    const ArrayView v = sim.worlds().state_component(component);
    return reinterpret_cast<double*>(v.data + w * v.strides[0]);
  };
  // A triangle wave, because results of libm functions differ between versions.
  const auto wave = [](double x) { return 4 * std::abs(x - std::floor(x + 0.5)) - 1; };
  const int key = m->nkey > 0 ? 0 : -1;
  sim.reset(worlds::all_worlds, key);
  for (int w = 0; w < kWorlds; ++w)
    for (int i = 0; i < m->nv; ++i) row("qvel", w)[i] += 0.1 * wave(0.37 * i + 0.21 * w);
  sim.forward();
  std::vector<Sensor*> sensors;
  for (const auto& s : sim.scene().sensors()) sensors.push_back(s.get());
  Hashes out;
  for (int k = 0; k < steps; ++k) {
    for (int w = 0; w < kWorlds; ++w)
      for (int i = 0; i < m->nu; ++i) row("ctrl", w)[i] = 0.4 * wave(0.05 * k + 0.3 * w + 0.19 * i);
    sim.step();
    if (k == steps / 2) {
      const int ids[] = {1};
      sim.reset(ids, key);
    }
    sim.refresh(sensors);
    add_state(sim, out);
    for (const Sensor* s : sensors) add_rows(*s, out);
  }
  return out;
}

// --- a Franka picks up objects: planner, controllers, core suite, two cameras with depth

Hashes pick() {
  unsetenv("MJSENSE_FRANKA_MESHES");
  tasks::rollout::RolloutCfg cfg;
  cfg.scene = "table";
  cfg.policy = "top_down_planner";
  cfg.num_worlds = 2;
  cfg.threads = 2;
  cfg.seed = 5;
  cfg.width = 64;
  cfg.height = 48;
  cfg.depth = true;
  tasks::rollout::Rollout rollout(cfg);
  const int worlds[] = {0, 1};
  const std::int64_t episodes[] = {0, 7};
  rollout.start(worlds, episodes);
  Hashes out;
  for (int k = 0; k < 45; ++k) {
    add_state(rollout.simulation(), out);
    for (const auto& sensor : rollout.suite().sensors()) add_rows(*sensor, out);
    for (const int w : worlds) {
      const tasks::episode::Evaluation& e = rollout.evaluation(w);
      out["reward"].add(DType::kFloat64, &e.reward, sizeof e.reward);
    }
    rollout.act();
    rollout.step();
  }
  return out;
}

// --- a legged robot on generated terrain: contacts, air time, an IMU modelled by its data sheet,
// height scans

constexpr char kDog[] = R"(
<mujoco>
  <default><geom friction=".9" solref=".01 1"/><joint damping=".4" armature=".01"/><position kp="30"/></default>
  <worldbody>
    <body name="trunk" pos="0 0 .42"><freejoint/><geom name="trunk" type="box" size=".2 .1 .05" mass="5"/>
      <site name="imu" pos=".05 0 .02" euler="2 3 90"/>
      <body name="lf" pos=".18 .12 0"><joint name="lf_hip" axis="0 1 0"/><geom name="lf_thigh" type="capsule" fromto="0 0 0 -.05 0 -.18" size=".02" mass=".3"/>
        <body pos="-.05 0 -.18"><joint name="lf_knee" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .05 0 -.18" size=".015" mass=".15"/>
        <geom name="lf_foot" pos=".05 0 -.18" size=".02" mass=".05"/><site name="lf_foot" pos=".05 0 -.18"/></body></body>
      <body name="rf" pos=".18 -.12 0"><joint name="rf_hip" axis="0 1 0"/><geom name="rf_thigh" type="capsule" fromto="0 0 0 -.05 0 -.18" size=".02" mass=".3"/>
        <body pos="-.05 0 -.18"><joint name="rf_knee" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .05 0 -.18" size=".015" mass=".15"/>
        <geom name="rf_foot" pos=".05 0 -.18" size=".02" mass=".05"/><site name="rf_foot" pos=".05 0 -.18"/></body></body>
      <body name="lh" pos="-.18 .12 0"><joint name="lh_hip" axis="0 1 0"/><geom name="lh_thigh" type="capsule" fromto="0 0 0 -.05 0 -.18" size=".02" mass=".3"/>
        <body pos="-.05 0 -.18"><joint name="lh_knee" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .05 0 -.18" size=".015" mass=".15"/>
        <geom name="lh_foot" pos=".05 0 -.18" size=".02" mass=".05"/><site name="lh_foot" pos=".05 0 -.18"/></body></body>
      <body name="rh" pos="-.18 -.12 0"><joint name="rh_hip" axis="0 1 0"/><geom name="rh_thigh" type="capsule" fromto="0 0 0 -.05 0 -.18" size=".02" mass=".3"/>
        <body pos="-.05 0 -.18"><joint name="rh_knee" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 .05 0 -.18" size=".015" mass=".15"/>
        <geom name="rh_foot" pos=".05 0 -.18" size=".02" mass=".05"/><site name="rh_foot" pos=".05 0 -.18"/></body></body>
    </body>
  </worldbody>
  <actuator>
    <position joint="lf_hip"/><position joint="lf_knee"/><position joint="rf_hip"/><position joint="rf_knee"/>
    <position joint="lh_hip"/><position joint="lh_knee"/><position joint="rh_hip"/><position joint="rh_knee"/>
  </actuator>
</mujoco>)";

Hashes legged() {
  scene::SceneCfg scene;
  scene.terrain = scene::TerrainCfg{.terrain_type = "generator",
                                    .levels = 2,
                                    .tile_size = {4, 4},
                                    .border = 1,
                                    .seed = 3,
                                    .daylight = false};
  for (const scene::SubTerrain kind : {scene::SubTerrain::kRough, scene::SubTerrain::kSlope,
                                       scene::SubTerrain::kStairs, scene::SubTerrain::kWaves}) {
    scene::SubTerrainCfg sub{.kind = kind};
    sub.platform_width = 1;
    scene.terrain->sub_terrains.emplace_back(enum_name(kind), sub);
  }
  add_entity(scene, "dog", kDog, {-1.2, -5.2, 0.75});
  const auto feet = std::vector<std::string>{".*_foot"};
  add<sensors::ContactSensorCfg>(scene, "feet", [&](auto& c) {
    c.primary = {.mode = "geom", .pattern = feet, .entity = "dog"};
    c.fields = {"found", "force", "torque", "dist", "pos", "normal", "tangent"};
    c.num_slots = 2;
    c.reduce = "maxforce";
    c.track_air_time = c.track_events = c.latch = true;
    c.history_length = 2;
  });
  add<sensors::ContactSensorCfg>(scene, "net", [&](auto& c) {
    c.primary = {.mode = "subtree", .pattern = {"trunk"}, .entity = "dog"};
    c.reduce = "netforce";
  });
  add<sensors::ImuSensorCfg>(scene, "imu", [](auto& c) {
    c.site = {"site", "imu", "dog"};
    c.preset = "mpu6050";
    c.orientation = true;
  });
  add<sensors::RayCastSensorCfg>(scene, "scan", [](auto& c) {
    c.frame = {{"body", "trunk", "dog"}};
    c.ray_alignment = "yaw";
    c.hit_ids = true;
  });
  add<sensors::TerrainHeightSensorCfg>(scene, "foot_height", [](auto& c) {
    for (const char* foot : {"lf_foot", "rf_foot", "lh_foot", "rh_foot"})
      c.frame.push_back({"site", foot, "dog"});
    c.pattern = sensors::RingPattern::single_ring(0.05, 6);
  });
  return play(std::move(scene), 60);
}

// --- features of images: textures, lights, shadows, sky, mirror, glass, a mesh, a lens, flow

constexpr char kStudio[] = R"(
<mujoco>
  <visual><headlight ambient=".2 .2 .2" diffuse=".3 .3 .3"/><map haze=".3"/><rgba haze=".7 .8 .9 1"/></visual>
  <asset>
    <texture name="grid" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .8 .7" width="64" height="64"/>
    <texture name="cube" type="cube" builtin="gradient" rgb1=".9 .6 .2" rgb2=".1 .2 .6" width="32" height="32"/>
    <texture type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2="0 0 .2" width="32" height="192"/>
    <material name="floor" texture="grid" texrepeat="4 4" texuniform="true" reflectance=".2"/>
    <material name="cube" texture="cube" shininess=".8" specular=".7"/><material name="glow" emission=".6" rgba=".8 .4 .1 1"/>
    <material name="wood" texture="grid" texrepeat="2 3"/>
    <mesh name="rock" vertex="0 0 0 .4 0 0 0 .4 0 0 0 .4 .3 .3 .1 .1 .3 .3 -.1 .1 .2"/>
  </asset>
  <worldbody>
    <light name="lamp" pos="1 -1 3" dir="-.3 .3 -1" cutoff="60" exponent="4" attenuation="1 .1 .02"/>
    <light name="sun" type="directional" pos="0 0 5" dir=".4 .2 -1" diffuse=".4 .4 .3"/>
    <geom name="floor" type="plane" size="0 0 .1" material="floor"/>
    <geom type="box" size=".3 .3 .3" pos="1 1 .3" material="cube"/><geom type="cylinder" size=".2 .4" pos="-1 .8 .4" material="wood"/>
    <geom type="ellipsoid" size=".3 .2 .4" pos="0 1.2 .4" material="wood"/><geom type="capsule" size=".1 .3" pos="-.5 1.5 .5" material="glow"/>
    <geom type="box" size=".4 .02 .4" pos=".2 .1 .5" rgba=".6 .8 .9 .4" contype="0" conaffinity="0"/>
    <body pos=".3 .6 .9"><freejoint/><geom type="mesh" mesh="rock" rgba=".5 .5 .55 1" mass="1"/></body>
    <body pos="-.4 .3 1.1"><freejoint/><geom type="sphere" size=".15" material="wood" mass="1"/></body>
    <body name="mover" pos="0 -1.6 1"><joint axis="0 0 1"/><geom size=".05" mass="1"/>
      <camera name="moving" pos="0 .2 .2" xyaxes="1 0 0 0 .4 1" fovy="60"/></body>
    <camera name="still" pos=".5 -2.2 1.6" xyaxes="1 .1 0 -.05 .5 1" fovy="50"/>
  </worldbody>
</mujoco>)";

Hashes studio() {
  scene::SceneCfg scene;
  scene.base.xml = kStudio;
  const auto camera = [&](const char* name, const char* of, std::vector<std::string> types,
                          auto&& more) {
    add<sensors::CameraSensorCfg>(scene, name, [&](auto& c) {
      c.camera_name = of;
      c.width = 72;
      c.height = 54;
      c.data_types = std::move(types);
      c.use_shadows = true;
      more(c);
    });
  };
  camera("still_eye", "still", {"rgb", "depth", "segmentation", "normals", "point_cloud"},
         [](auto&) {});
  camera("moving_eye", "moving", {"rgb", "depth", "flow", "body_segmentation"}, [](auto& c) {
    c.samples = 4;
    c.width = 40;
    c.height = 30;
  });
  camera("fisheye", "moving", {"rgb", "depth"}, [](auto& c) {
    c.intrinsics = sensors::CameraIntrinsics{30, 30, 36, 27};
    c.distortion = {"fisheye", {0.01, 0.002, 0, 0}};
    c.depth_kind = "ray";
  });
  camera("parallel", "still", {"rgb", "segmentation"}, [](auto& c) {
    c.orthographic = true;
    c.fovy = 3;
  });
  return play(std::move(scene), 10);
}

// --- deformable objects: cloth and a rope, in images and in ray casts

constexpr char kSoft[] = R"(
<mujoco>
  <option solver="CG" tolerance="1e-6" timestep=".002"/>
  <worldbody>
    <light pos="0 0 4" dir="0 0 -1"/><geom name="floor" type="plane" size="0 0 .1"/><geom name="ball" size=".25" pos="0 0 .3"/>
    <flexcomp name="cloth" type="grid" dim="2" count="6 6 1" spacing=".12 .12 .1" pos="0 0 .75" radius=".01" mass=".3" rgba=".9 .2 .1 1">
      <edge equality="true" damping=".01"/><contact selfcollide="none"/></flexcomp>
    <flexcomp name="rope" type="grid" dim="1" count="8 1 1" spacing=".1 .1 .1" pos=".7 0 .6" radius=".02" mass=".1" rgba=".2 .4 .9 1">
      <edge equality="true"/></flexcomp>
    <body name="mast" pos="0 -1.5 1.2"><site name="eye" zaxis="0 1 -.6"/><camera name="eye" xyaxes="1 0 0 0 .6 1" fovy="55"/></body>
  </worldbody>
</mujoco>)";

Hashes soft() {
  scene::SceneCfg scene;
  scene.base.xml = kSoft;
  add<sensors::CameraSensorCfg>(scene, "camera", [](auto& c) {
    c.camera_name = "eye";
    c.width = 64;
    c.height = 48;
    c.data_types = {"rgb", "depth", "segmentation", "normals"};
    c.use_shadows = true;
  });
  add<sensors::LidarSensorCfg>(scene, "lidar", [](auto& c) {
    c.frame = {{"site", "eye", ""}};
    c.scan = sensors::SpinningScan{.channels = 8, .samples = 90};
  });
  return play(std::move(scene), 25);
}

// --- effects: noise, bias, delay, rate, dropout, quantisation; noise of lidars and stereo cameras

constexpr char kDevices[] = R"(
<mujoco>
  <worldbody>
    <light pos="0 0 3"/><geom name="floor" type="plane" size="0 0 .1"/><geom type="box" size=".3 2 1" pos="2 0 1" rgba=".7 .3 .2 1"/>
    <body name="arm" pos="0 0 1"><joint name="a" axis="0 1 0" damping=".3"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/>
      <body pos=".3 0 0"><joint name="b" axis="0 0 1" damping=".1"/><geom type="box" size=".08 .03 .03" pos=".08 0 0" mass=".4"/>
        <site name="tip" pos=".1 0 0"/><camera name="tip" pos=".1 0 0" xyaxes="0 -1 0 0 0 1" fovy="60"/></body></body>
  </worldbody>
  <actuator><motor name="a" joint="a" gear="12"/><motor name="b" joint="b" gear="2"/></actuator>
  <sensor><accelerometer name="acc" site="tip"/><gyro name="gyro" site="tip"/><framepos name="pos" objtype="site" objname="tip"/></sensor>
</mujoco>)";

Hashes devices() {
  scene::SceneCfg scene;
  scene.base.xml = kDevices;
  const auto effects = [&](const char* name, const char* sensor, effects::Effects list,
                           int history = 0) {
    add<effects::EffectSensorCfg>(scene, name, [&](auto& c) {
      c.sensor = sensor;
      c.effects = std::move(list);
      c.history_length = history;
    });
  };
  const auto one = [](auto effect) {
    return std::make_shared<decltype(effect)>(std::move(effect));
  };
  effects::BiasDrift drift;
  drift.std = {0.05};
  drift.time_constant_s = 0.3;
  effects::Misalignment axes;
  axes.scale_error_std = 0.02;
  axes.angle_std = 0.03;
  effects::Delay delay(0.005);
  delay.delay_max_s = 0.03;
  delay.jitter_s = 0.004;
  delay.interpolate = true;
  effects::StepDelay lag;
  lag.max_lag = 3;
  lag.hold_probability = 0.3;
  effects(
      "noisy", "acc",
      {one(axes), one(effects::EpisodeBias(effects::Draw::gaussian({0.1, 0.2, 0.3}))), one(drift),
       one(effects::Noise::with_density({0.01})), one(effects::Clip::saturation(15)),
       one(effects::Quantize(effects::PerComponent{0.02}))});
  effects("late", "gyro", {one(effects::Noise(effects::Draw::uniform({-0.1}, {0.1}))), one(delay)},
          3);
  effects("slow", "pos", {one(effects::Rate(60, 0.003)), one(effects::Dropout(0.3))});
  effects("lagging", "pos", {one(lag), one(effects::Dropout(0.1, effects::Dropout::Mode::kZero))});
  add<sensors::LidarSensorCfg>(scene, "lidar", [](auto& c) {
    c.frame = {{"site", "tip", ""}};
    c.scan = sensors::SpinningScan{.channels = 4, .samples = 60};
    c.range_noise_std = 0.01;
    c.range_noise_relative = 0.005;
    c.dropout = 0.05;
    c.motion_distortion = true;
  });
  add<sensors::CameraSensorCfg>(scene, "stereo", [](auto& c) {
    c.camera_name = "tip";
    c.width = 48;
    c.height = 36;
    c.data_types = {"depth"};
    c.depth_noise = "d435";
    c.update_period = 0.02;
  });
  return play(std::move(scene), 40);
}

// ---

constexpr struct {
  const char* name;
  Hashes (*play)();
} kScenes[] = {
    {"pick", pick}, {"legged", legged}, {"studio", studio}, {"soft", soft}, {"devices", devices}};

// CPU features by which the C library and Embree select their code.
std::string cpu_level() {
  if (!kHasAvx) return "aarch64";
  return best_isa() == Isa::kPortable ? "sse" : std::string(isa_name(best_isa()));
}

// "cpu kernels scene what" -> hash
using Lines = std::map<std::string, std::string>;

Lines read(const std::string& path) {
  std::ifstream in(path);
  if (!in) throw ValueError(fmt::format("golden: cannot read '{}'", path));
  Lines lines;
  for (std::string line; std::getline(in, line);) {
    const std::size_t space = line.rfind(' ');
    if (line.empty() || line[0] == '#' || space == std::string::npos) continue;
    lines[line.substr(0, space)] = line.substr(space + 1);
  }
  return lines;
}

// A line "scene what|dtype|bytes" before the bytes of each.
void write_values(const std::string& path) {
  keep_values = true;
  std::ofstream out(path, std::ios::binary);
  for (const auto& [scene, play_it] : kScenes) {
    for (const auto& [what, hash] : play_it())
      out << fmt::format("{} {}|{}|{}\n", scene, what, dtype_name(hash.dtype()), hash.rows().size())
          << hash.rows();
  }
  if (!out.flush()) throw RuntimeError(fmt::format("golden: cannot write '{}'", path));
}

int run(const std::string& path) {
  const bool print = path == "--print";
  const std::string cpu = cpu_level(), kernels(isa_name(cpu_isa())),
                    prefix = cpu + " " + kernels + " ";
  Lines known = print ? Lines{} : read(path);
  std::erase_if(known, [&](const auto& line) { return !line.first.starts_with(prefix); });
  if (!print && known.empty()) {
    fmt::print(
        "golden: no hashes of a CPU with {} and kernels {} in {}: tests/golden/renew.py adds "
        "them\n",
        cpu, kernels, path);
    return 77;
  }
  int different = 0;
  for (const auto& [scene, play_it] : kScenes) {
    for (const auto& [what, hash] : play_it()) {
      const std::string key = fmt::format("{}{} {}", prefix, scene, what);
      if (print) {
        fmt::print("{} {}\n", key, hash.text());
        continue;
      }
      const auto line = known.find(key);
      const std::string expected = line == known.end() ? "nothing (it is new)" : line->second;
      if (expected != hash.text()) {
        fmt::print("golden: scene '{}', {}, kernels {} on a CPU with {}: {} instead of {}\n", scene,
                   what == "state" ? "the state" : "sensor '" + what + "'", kernels, cpu,
                   hash.text(), expected);
        ++different;
      }
      if (line != known.end()) known.erase(line);
    }
  }
  for (const auto& [key, hash] : known) {
    fmt::print("golden: '{}' is in the file and no longer computed\n", key);
    ++different;
  }
  if (different > 0) {
    fmt::print(
        "golden: {} values have other bits. Meant? Then: python tests/golden/renew.py \"why\"\n",
        different);
  }
  return different > 0;
}

}  // namespace
}  // namespace mjsense

int main(int argc, char** argv) {
  try {
    if (argc == 3 && std::string(argv[1]) == "--values") return mjsense::write_values(argv[2]), 0;
    return mjsense::run(argc > 1 ? argv[1] : MJSENSE_GOLDEN_FILE);
  } catch (const mjsense::RuntimeError&
               error) {  // MJSENSE_ISA names an instruction set that this CPU lacks
    fmt::print("golden: {}\n", error.what());
    return 77;
  } catch (const std::exception& error) {
    fmt::print(stderr, "golden: {}\n", error.what());
    return 1;
  }
}
