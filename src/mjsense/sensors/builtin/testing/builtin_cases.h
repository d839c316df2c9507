// SPDX-License-Identifier: Apache-2.0
#pragma once
// For tests: built-in sensors of every type, as XML and as configuration, on a robot that has
// elements of every kind.

#include <fmt/format.h>

#include <string>
#include <utility>
#include <vector>

#include "mjsense/sensors/builtin/builtin_sensor.h"

namespace mjsense::sensors {

// A robot with elements of every kind that a sensor can be attached to. `sensors`: XML of its
// sensors.
inline std::string robot(const std::string& sensors) {
  return R"(<mujoco>
  <asset><mesh name="plate" builtin="plate" params="3 3" scale=".2 .2 .02"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="3 3 .1"/>
    <body name="base" pos="0 0 .4"><freejoint name="root"/>
      <geom name="base" type="box" size=".2 .15 .1" mass="4"/>
      <geom name="pad" type="mesh" mesh="plate" contype="0" conaffinity="0" pos="0 0 -.1" mass="0"/>
      <site name="imu" pos=".1 .05 .02" euler="10 20 30"/>
      <site name="down" pos="0 0 -.12" euler="180 0 0"/>
      <site name="zone" type="box" size=".3 .3 .2" pos="0 0 -.05"/>
      <camera name="cam" pos=".2 0 .1" euler="20 -60 0" resolution="3 2" fovy="60"/>
      <body name="upper" pos=".3 0 0"><joint name="hinge" axis="0 1 0" range="-30 30"/>
        <geom name="upper" type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1"/>
        <body name="fore" pos=".3 0 0"><joint name="slide" type="slide" axis="1 0 0" range="-.1 .1"/>
          <geom name="fore" type="capsule" fromto=".05 0 0 .2 0 0" size=".02" mass=".5"/>
          <body name="hand" pos=".3 0 0"><joint name="ball" type="ball"/>
            <geom name="hand" size=".04" mass=".3" pos="0 0 .05"/><site name="ft" euler="0 30 0"/>
          </body></body></body></body>
  </worldbody>
  <tendon><fixed name="tendon" range="-.1 .1"><joint joint="hinge" coef=".5"/><joint joint="slide" coef="2"/></fixed></tendon>
  <actuator><motor name="motor" joint="hinge" gear="3"/><position name="servo" joint="slide" kp="50"/>
    <motor name="pull" tendon="tendon" gear="2"/></actuator>
  <sensor>)" +
         sensors + "</sensor></mujoco>";
}

// One sensor of every type (several for those with variants), as XML and as configuration.
struct Case {
  std::string xml;
  BuiltinSensorCfg cfg;
};

inline scene::ObjRef in_robot(const std::string& type, const std::string& name) {
  return {type, name, "robot"};
}

inline std::vector<Case> all_cases() {
  std::vector<Case> cases;
  const auto add = [&](const std::string& type, const std::string& attributes, scene::ObjRef obj,
                       scene::ObjRef ref = {}) -> Case& {
    const std::string name = fmt::format("{}_{}", type, cases.size());
    BuiltinSensorCfg cfg;
    cfg.name = "cfg_" + name;
    cfg.sensor_type = type;
    cfg.obj = std::move(obj);
    cfg.ref = std::move(ref);
    cases.push_back({fmt::format("<{} name='xml_{}' {}/>", type, name, attributes), cfg});
    return cases.back();
  };
  for (const char* type : {"accelerometer", "velocimeter", "gyro", "magnetometer"}) {
    add(type, "site='imu'", in_robot("site", "imu"));
  }
  for (const char* type : {"force", "torque"}) add(type, "site='ft'", in_robot("site", "ft"));
  add("touch", "site='zone'", in_robot("site", "zone"));
  add("rangefinder", "site='down'", in_robot("site", "down"));
  add("rangefinder", "camera='cam' data='dist dir origin point normal depth'",
      in_robot("camera", "cam"))
      .cfg.data = {"dist", "dir", "origin", "point", "normal", "depth"};
  add("rangefinder", "camera='cam' data='point depth'", in_robot("camera", "cam")).cfg.data = {
      "point", "depth"};
  add("camprojection", "site='ft' camera='cam'", in_robot("site", "ft"), in_robot("camera", "cam"));
  for (const char* joint : {"hinge", "slide"}) {
    for (const char* type : {"jointpos", "jointvel", "jointlimitpos", "jointlimitvel",
                             "jointlimitfrc", "jointactuatorfrc"}) {
      add(type, fmt::format("joint='{}'", joint), in_robot("joint", joint));
    }
  }
  for (const char* type : {"ballquat", "ballangvel"})
    add(type, "joint='ball'", in_robot("joint", "ball"));
  for (const char* type : {"tendonpos", "tendonvel", "tendonactuatorfrc", "tendonlimitpos",
                           "tendonlimitvel", "tendonlimitfrc"}) {
    add(type, "tendon='tendon'", in_robot("tendon", "tendon"));
  }
  for (const char* type : {"actuatorpos", "actuatorvel", "actuatorfrc"}) {
    for (const char* actuator : {"motor", "servo", "pull"}) {
      add(type, fmt::format("actuator='{}'", actuator), in_robot("actuator", actuator));
    }
  }
  const std::vector<std::pair<const char*, const char*>> objects = {
      {"body", "fore"}, {"xbody", "fore"}, {"geom", "fore"}, {"site", "ft"}, {"camera", "cam"}};
  for (const char* type : {"framepos", "framequat", "framexaxis", "frameyaxis", "framezaxis",
                           "framelinvel", "frameangvel", "framelinacc", "frameangacc"}) {
    for (const auto& [obj, name] : objects) {
      add(type, fmt::format("objtype='{}' objname='{}'", obj, name), in_robot(obj, name));
      // In a configuration the accelerations accept a ref and ignore it; MJCF does not accept it.
      const bool ignored = std::string(type).ends_with("acc");
      add(type,
          fmt::format("objtype='{}' objname='{}' {}", obj, name,
                      ignored ? "" : "reftype='site' refname='imu'"),
          in_robot(obj, name), in_robot("site", "imu"));
    }
  }
  for (const char* type : {"subtreecom", "subtreelinvel", "subtreeangmom"})
    add(type, "body='upper'", in_robot("body", "upper"));
  for (const char* type : {"e_potential", "e_kinetic", "clock"}) add(type, "", {});
  add("insidesite", "objtype='xbody' objname='hand' site='zone'", in_robot("xbody", "hand"),
      in_robot("site", "zone"));
  add("insidesite", "objtype='geom' objname='base' site='zone' enclosed='true'",
      in_robot("geom", "base"), in_robot("site", "zone"))
      .cfg.enclosed = true;
  for (const char* type : {"distance", "normal", "fromto"}) {
    add(type, "geom1='hand' geom2='base' cutoff='2'", in_robot("geom", "hand"),
        in_robot("geom", "base"))
        .cfg.cutoff = 2;
    add(type, "body1='hand' geom2='base' cutoff='.1'", in_robot("body", "hand"),
        in_robot("geom", "base"))
        .cfg.cutoff = .1;
  }
  add("tactile", "mesh='plate' geom='pad'", in_robot("mesh", "plate"), in_robot("geom", "pad"));
  Case& user =
      add("user", "dim='3' needstage='vel' datatype='positive' objtype='body' objname='hand'",
          in_robot("body", "hand"));
  user.cfg.dim = 3;
  user.cfg.needstage = "vel";
  user.cfg.datatype = "positive";
  for (double cutoff : {.05, 2.0}) {
    for (const char* type : {"accelerometer", "rangefinder"}) {
      const char* site = type[0] == 'a' ? "imu" : "down";
      add(type, fmt::format("site='{}' cutoff='{}'", site, cutoff), in_robot("site", site))
          .cfg.cutoff = cutoff;
    }
  }
  Case& delayed =
      add("gyro", "site='imu' nsample='4' delay='.006' interp='linear'", in_robot("site", "imu"));
  delayed.cfg.nsample = 4;
  delayed.cfg.delay = .006;
  delayed.cfg.interp = "linear";
  Case& slow =
      add("jointpos", "joint='hinge' nsample='3' delay='.004' interval='.005 -.001' interp='cubic'",
          in_robot("joint", "hinge"));
  slow.cfg.nsample = 3;
  slow.cfg.delay = .004;
  slow.cfg.interval = .005;
  slow.cfg.phase = -.001;
  slow.cfg.interp = "cubic";
  return cases;
}

}  // namespace mjsense::sensors
