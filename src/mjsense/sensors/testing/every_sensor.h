#pragma once
// One of every kind of scene sensor, in a scene where all of them have something to measure. Tests that hold for all sensors
// (sensors/lockstep_test.cc) take this list.

#include <memory>
#include <utility>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/builtin/builtin_sensor.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense/sensors/contact/contact_sensor.h"
#include "mjsense/sensors/lidar/lidar_sensor.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"
#include "mjsense/sensors/terrain_height/terrain_height_sensor.h"

namespace mjsense {
namespace every_sensor_detail {

inline constexpr char kRobot[] = R"(
<mujoco>
  <asset>
    <texture name="grid" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .8 .7" width="64" height="64"/>
    <texture type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2="0 0 .2" width="32" height="192"/>
    <material name="grid" texture="grid" texrepeat="4 4"/>
  </asset>
  <worldbody>
    <light pos="1 -1 3" dir="-.3 .3 -1"/>
    <body name="trunk" pos="0 0 .5"><freejoint name="root"/>
      <geom name="trunk" type="box" size=".2 .15 .1" mass="4" material="grid"/>
      <site name="imu" pos=".1 0 .02" euler="5 10 15"/>
      <camera name="eye" pos=".2 0 .1" xyaxes="0 -1 0 .3 0 1"/>
      <body name="left_wheel" pos="0 .2 -.1"><joint name="left" axis="0 1 0"/>
        <geom name="left_wheel" type="cylinder" euler="90 0 0" size=".1 .02" mass=".3"/></body>
      <body name="right_wheel" pos="0 -.2 -.1"><joint name="right" axis="0 1 0"/>
        <geom name="right_wheel" type="cylinder" euler="90 0 0" size=".1 .02" mass=".3"/></body>
      <body name="arm" pos=".2 0 .1"><joint name="arm" axis="0 1 0" damping=".2"/>
        <geom name="arm" type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".4"/></body>
    </body>
  </worldbody>
  <actuator><motor name="left" joint="left"/><motor name="right" joint="right"/><motor name="arm" joint="arm" gear="3"/></actuator>
</mujoco>)";

inline constexpr char kBox[] = R"(
<mujoco><worldbody><body name="box" pos=".8 .1 .3"><freejoint/>
  <geom name="box" type="box" size=".1 .1 .1" mass=".2" rgba=".8 .3 .2 1"/></body></worldbody></mujoco>)";
inline constexpr char kBall[] = R"(
<mujoco><worldbody><body name="ball" pos=".7 -.3 .4"><freejoint/>
  <geom name="ball" type="sphere" size=".1" mass=".2" rgba=".2 .7 .3 1"/></body></worldbody></mujoco>)";
inline constexpr char kWedge[] = R"(
<mujoco><asset><mesh name="wedge" vertex="0 0 0 .2 0 0 0 .2 0 0 0 .2"/></asset>
  <worldbody><body name="wedge" pos="1.1 0 .3"><freejoint/><geom name="wedge" type="mesh" mesh="wedge" mass=".2"/></body></worldbody></mujoco>)";

template <class Cfg, class Fill>
std::shared_ptr<const SensorCfg> make(const char* name, Fill&& fill) {
  auto cfg = std::make_shared<Cfg>();
  cfg->name = name;
  fill(*cfg);
  return cfg;
}

}  // namespace every_sensor_detail

// One of every kind of scene sensor. A new kind adds its lines here.
inline std::vector<std::shared_ptr<const SensorCfg>> every_sensor() {
  using every_sensor_detail::make;
  return {
      make<BuiltinSensorCfg>("acc",
                             [](auto& c) {
                               c.sensor_type = "accelerometer";
                               c.obj = {"site", "imu", "robot"};
                             }),
      make<ContactSensorCfg>("touch",
                             [](auto& c) {
                               c.primary = {.mode = "body", .pattern = {".*"}, .entity = "robot"};
                               c.fields = {"found", "force", "dist", "pos", "normal"};
                               c.num_slots = 2;
                               c.track_air_time = c.latch = true;
                               c.history_length = 3;
                             }),
      make<RayCastSensorCfg>("scan",
                             [](auto& c) {
                               c.frame = {{"body", "trunk", "robot"}};
                               c.ray_alignment = "yaw";
                             }),
      make<TerrainHeightSensorCfg>("height",
                                   [](auto& c) {
                                     c.frame = {{"site", "imu", "robot"}};
                                   }),
      make<LidarSensorCfg>("lidar",
                           [](auto& c) {
                             c.frame = {{"site", "imu", "robot"}};
                             c.scan = SpinningScan{.channels = 4, .samples = 60};
                             c.motion_distortion = true;
                             c.range_noise_std = 0.01;
                             c.dropout = 0.1;
                           }),
      make<CameraSensorCfg>("eye",
                            [](auto& c) {
                              c.camera_name = "robot/eye";
                              c.width = 48;
                              c.height = 32;
                              c.data_types = {"rgb", "depth", "segmentation", "flow"};
                              c.use_shadows = true;
                            }),
      make<CameraSensorCfg>(
          "flow",
          [](auto& c) {
            c.camera_name = "robot/eye";
            c.width = 40;
            c.height = 40;
            c.data_types = {"flow", "normals", "body_segmentation", "entity_segmentation"};
            c.intrinsics = CameraIntrinsics{20, 20, 20, 20};
            c.distortion = {"fisheye", {0.01, 0, 0, 0}};
            c.update_period = 0.01;
          }),
  };
}

// A two-wheeled robot with a mast and an arm that swings; a box, a ball and a mesh to see and to touch; textures and a light.
inline SceneCfg every_sensor_scene() {
  using namespace every_sensor_detail;
  SceneCfg cfg;
  for (const auto& [name, xml] :
       {std::pair{"robot", kRobot}, {"box", kBox}, {"ball", kBall}, {"wedge", kWedge}}) {
    EntityCfg entity;
    entity.model.xml = xml;
    cfg.entities.emplace_back(name, entity);
  }
  cfg.terrain = TerrainCfg{};
  cfg.sensors = every_sensor();
  return cfg;
}

}  // namespace mjsense
