// SPDX-License-Identifier: Apache-2.0
#pragma once
// Every kind of scene sensor, in a scene where each of them has something to measure. For tests
// that apply to all sensors.

#include <algorithm>
#include <iterator>
#include <memory>
#include <utility>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/all_sensors.h"
#include "mjsense/sensors/testing/example.h"

namespace mjsense::sensors {

#define MJSENSE_DECLARE(name) SensorCfgs name##_examples();
MJSENSE_SENSORS(MJSENSE_DECLARE)
#undef MJSENSE_DECLARE

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

}  // namespace every_sensor_detail

// The examples from the folders of all sensors.
inline SensorCfgs every_sensor() {
  SensorCfgs all;
#define MJSENSE_ADD(name) std::ranges::copy(name##_examples(), std::back_inserter(all));
  MJSENSE_SENSORS(MJSENSE_ADD)
#undef MJSENSE_ADD
  return all;
}

// A two-wheeled robot with an arm that swings; a box, a ball and a mesh that can be seen and
// touched; textures and a light.
inline scene::SceneCfg every_sensor_scene() {
  using namespace every_sensor_detail;
  scene::SceneCfg cfg;
  for (const auto& [name, xml] :
       {std::pair{"robot", kRobot}, {"box", kBox}, {"ball", kBall}, {"wedge", kWedge}}) {
    scene::EntityCfg entity;
    entity.model.xml = xml;
    cfg.entities.emplace_back(name, entity);
  }
  cfg.terrain = scene::TerrainCfg{};
  cfg.sensors = every_sensor();
  return cfg;
}

}  // namespace mjsense::sensors
