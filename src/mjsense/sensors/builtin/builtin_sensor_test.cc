// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/builtin/builtin_sensor.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/mujoco_objects.h"
#include "mjsense/core/rng.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/model_sensors/builtin_types.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/builtin/testing/builtin_cases.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::HasSubstr;

class Bench {
 public:
  explicit Bench(scene::SceneCfg cfg) : scene_(std::move(cfg)), data_(mj_makeData(scene_.model())) {
    for (const auto& sensor : scene_.sensors()) sensor->initialize({scene_.model(), &scene_, 2});
  }
  const mjModel* model() const { return scene_.model(); }
  mjData* data() { return data_.get(); }
  scene::Scene& scene() { return scene_; }

  // Returns row 1 of 2; row 0 must stay zero.
  std::vector<float> read(const std::string& key, const std::string& field = "") {
    Sensor& sensor = scene_.sensor(key);
    sensor.compute({.id = 1, .model = model(), .data = data()});
    const auto row = sensor.field(field).data.row<float>(1);
    for (float x : sensor.field(field).data.row<float>(0)) EXPECT_EQ(x, 0.0f);
    return {row.begin(), row.end()};
  }

 private:
  scene::Scene scene_;
  DataPtr data_;
};

void randomize(const mjModel* m, mjData* d, Rng& rng) {
  for (int i = 0; i < m->nq; ++i) d->qpos[i] = m->qpos0[i] + rng.uniform(-.3, .3);
  mj_normalizeQuat(m, d->qpos);
  for (int i = 0; i < m->nv; ++i) d->qvel[i] = rng.uniform(-2, 2);
  for (int i = 0; i < m->nu; ++i) d->ctrl[i] = rng.uniform(-1, 1);
}

// Makes another robot with the same names: every pose, axis, size and mass changes at random.
void disturb(mjSpec* spec, int seed) {
  Rng rng(seed, 7, 0, 0);
  const auto move = [&](double* pos, double* quat) {
    for (int i = 0; i < 3; ++i) pos[i] += rng.uniform(-.05, .05);
    for (int i = 0; i < 4; ++i) quat[i] += rng.uniform(-.2, .2);
  };
  for (mjsElement* e : scene::spec_elements(spec, mjOBJ_BODY)) {
    mjsBody* body = mjs_asBody(e);
    if (scene::element_name(e) != "world") move(body->pos, body->quat);
  }
  for (mjsElement* e : scene::spec_elements(spec, mjOBJ_SITE))
    move(mjs_asSite(e)->pos, mjs_asSite(e)->quat);
  for (mjsElement* e : scene::spec_elements(spec, mjOBJ_CAMERA)) {
    move(mjs_asCamera(e)->pos, mjs_asCamera(e)->quat);
  }
  for (mjsElement* e : scene::spec_elements(spec, mjOBJ_JOINT)) {
    for (double& x : mjs_asJoint(e)->axis) x += rng.uniform(-.5, .5);
    mjs_asJoint(e)->damping[0] = rng.uniform(0, 1);
  }
  for (mjsElement* e : scene::spec_elements(spec, mjOBJ_GEOM)) {
    if (mjs_asGeom(e)->type == mjGEOM_PLANE || mjs_asGeom(e)->type == mjGEOM_MESH) continue;
    mjs_asGeom(e)->mass = rng.uniform(.1, 3);
    mjs_asGeom(e)->size[0] *= rng.uniform(.7, 1.4);
  }
}

// Configured sensors, sensors found in the XML, and MuJoCo alone on the same XML give the same
// numbers, on random robots in random states.
TEST(BuiltinSensor, EveryTypeAgreesWithMujoco) {
  const std::vector<Case> cases = all_cases();
  std::string sensors;
  for (const Case& c : cases) sensors += c.xml;
  std::set<std::string> types, moved;
  for (int model = 0; model < 10; ++model) {
    scene::SceneCfg cfg;
    for (const Case& c : cases) cfg.sensors.push_back(std::make_shared<BuiltinSensorCfg>(c.cfg));
    cfg.entities = {{"robot", {.model = {.xml = robot(sensors)}}}};
    if (model > 0) cfg.spec_fn = [&](mjSpec* spec) { disturb(spec, model); };
    Bench bench(std::move(cfg));

    // The same model without mjsense: only the prefixes of names differ.
    char error[1000] = "";
    scene::SpecPtr spec(mj_parseXMLString(robot(sensors).c_str(), nullptr, error, sizeof error));
    ASSERT_TRUE(spec) << error;
    spec->option = bench.model()->opt;
    if (model > 0) disturb(spec.get(), model);
    ModelPtr plain(mj_compile(spec.get(), nullptr));
    ASSERT_TRUE(plain) << mjs_getError(spec.get());
    DataPtr data(mj_makeData(plain.get()));

    for (int trial = 0; trial < 5; ++trial) {
      Rng a(trial, model, 0, 0), b(trial, model, 0, 0);
      mj_resetData(bench.model(), bench.data());
      mj_resetData(plain.get(), data.get());
      randomize(bench.model(), bench.data(), a);
      randomize(plain.get(), data.get(), b);
      for (int k = 0; k < 5; ++k) {
        mj_step(bench.model(), bench.data());
        mj_step(plain.get(), data.get());
      }
      mj_forward(bench.model(), bench.data());
      mj_forward(plain.get(), data.get());
      for (const Case& c : cases) {
        const std::string local = c.cfg.name.substr(4);
        const auto configured = bench.read(c.cfg.key());
        const auto found = bench.read("robot/xml_" + local);
        const int id = mj_name2id(plain.get(), mjOBJ_SENSOR, ("xml_" + local).c_str());
        ASSERT_GE(id, 0) << local;
        ASSERT_EQ(configured.size(), static_cast<std::size_t>(plain->sensor_dim[id])) << local;
        ASSERT_EQ(found.size(), configured.size()) << local;
        const auto& about = bench.scene().sensor(c.cfg.key()).field().spec;
        for (std::size_t i = 0; i < configured.size(); ++i) {
          const float expected = static_cast<float>(data->sensordata[plain->sensor_adr[id] + i]);
          EXPECT_EQ(configured[i], expected) << local << " " << i << " of model " << model;
          EXPECT_EQ(found[i], expected) << local << " " << i << " of model " << model;
          EXPECT_GE(configured[i], about.low - 1e-5) << local;
          EXPECT_LE(configured[i], about.high + 1e-5) << local;
          if (expected != 0) moved.insert(c.cfg.sensor_type);
        }
        types.insert(c.cfg.sensor_type);
      }
    }
  }
  for (const scene::BuiltinType& type : scene::builtin_types()) {
    if (type.name == "contact" || type.name == "plugin") continue;
    EXPECT_TRUE(types.count(std::string(type.name))) << type.name << " is not tested";
    EXPECT_EQ(moved.count(std::string(type.name)), type.name != "user" ? 1u : 0u)
        << type.name << " was always 0";
  }
}

std::string message_of(const std::function<void()>& body) {
  try {
    body();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

BuiltinSensorCfg make(const std::string& type, scene::ObjRef obj = {}, scene::ObjRef ref = {}) {
  BuiltinSensorCfg cfg;
  cfg.name = "s";
  cfg.sensor_type = type;
  cfg.obj = std::move(obj);
  cfg.ref = std::move(ref);
  return cfg;
}

TEST(BuiltinSensor, ValidatesItsConfiguration) {
  const auto fault = [](BuiltinSensorCfg cfg,
                        const std::function<void(BuiltinSensorCfg&)>& edit = {}) {
    if (edit) edit(cfg);
    return message_of([&] { cfg.validate(); });
  };
  const scene::ObjRef site = in_robot("site", "imu");
  EXPECT_EQ(fault(make("gyro", site)), "no error");
  EXPECT_EQ(fault(make("gyroo", site)),
            "sensor 'robot/s': unknown sensor_type 'gyroo'; did you mean 'gyro'?");
  EXPECT_THAT(fault(make("contact", site)), HasSubstr("unknown sensor_type 'contact'"));
  EXPECT_EQ(fault(make("gyro")), "sensor 's': gyro requires obj (type site)");
  EXPECT_EQ(fault(make("gyro", in_robot("body", "base"))),
            "sensor 'robot/s': gyro requires obj.type site, not 'body'");
  EXPECT_EQ(fault(make("framepos", in_robot("joint", "hinge"))),
            "sensor 'robot/s': framepos requires obj.type body, xbody, geom, site or camera, not "
            "'joint'");
  EXPECT_EQ(fault(make("subtreecom", in_robot("xbody", "base"))),
            "sensor 'robot/s': subtreecom requires obj.type body, not 'xbody'");
  EXPECT_EQ(fault(make("jointpos", site)),
            "sensor 'robot/s': jointpos requires obj.type joint, not 'site'");
  EXPECT_EQ(fault(make("tendonpos", site)),
            "sensor 'robot/s': tendonpos requires obj.type tendon, not 'site'");
  EXPECT_EQ(fault(make("actuatorfrc", site)),
            "sensor 'robot/s': actuatorfrc requires obj.type actuator, not 'site'");
  EXPECT_EQ(fault(make("gyro", site, site)), "sensor 'robot/s': gyro takes no ref");
  EXPECT_EQ(fault(make("clock", {}, site)), "sensor 's': clock takes no ref");
  EXPECT_EQ(fault(make("clock", site)), "no error");
  EXPECT_EQ(fault(make("framepos", site, in_robot("joint", "hinge"))),
            "sensor 'robot/s': framepos requires ref.type body, xbody, geom, site or camera, not "
            "'joint'");
  EXPECT_EQ(fault(make("camprojection", site)),
            "sensor 'robot/s': camprojection requires ref (type camera)");
  EXPECT_THAT(fault(make("framequat", site), [](auto& c) { c.cutoff = .3; }),
              HasSubstr("cutoff = 0.3"));
  EXPECT_EQ(fault(make("framequat", site), [](auto& c) { c.cutoff = -1; }), "no error");
  EXPECT_THAT(fault(make("gyro", site), [](auto& c) { c.delay = .1; }), HasSubstr("nsample > 0"));
  EXPECT_THAT(
      fault(make("gyro", site), [](auto& c) { c.nsample = 2, c.interval = .01, c.phase = -.01; }),
      HasSubstr("(-interval, 0]"));
  EXPECT_THAT(fault(make("rangefinder", site), [](auto& c) { c.data = {"range"}; }),
              HasSubstr("data is 'range': must be one of dist, dir, origin"));
  EXPECT_THAT(fault(make("rangefinder", site),
                    [](auto& c) {
                      c.data = {"point", "dist"};
                    }),
              HasSubstr("in the order"));
  EXPECT_THAT(fault(make("rangefinder", site), [](auto& c) { c.data = {}; }),
              HasSubstr("without data"));
  EXPECT_THAT(fault(make("user")), HasSubstr("dim >= 1"));
  EXPECT_THAT(fault(make("plugin")), HasSubstr("plugin or instance"));
  EXPECT_THAT(fault(make("gyro", site), [](auto& c) { c.name = ""; }), HasSubstr("needs a name"));
}

scene::SceneCfg with(std::vector<BuiltinSensorCfg> sensors, const std::string& xml = "") {
  scene::SceneCfg cfg;
  cfg.entities = {{"robot", {.model = {.xml = robot(xml)}}}};
  for (auto& s : sensors) cfg.sensors.push_back(std::make_shared<BuiltinSensorCfg>(std::move(s)));
  return cfg;
}

TEST(BuiltinSensor, SceneErrorsNameTheSensor) {
  const auto fault = [](std::vector<BuiltinSensorCfg> sensors, const std::string& xml = "") {
    return message_of([&] { scene::Scene scene(with(std::move(sensors), xml)); });
  };
  EXPECT_THAT(fault({make("gyro", in_robot("site", "imuu"))}),
              HasSubstr("sensor 'robot/s': no site named 'robot/imuu'; did you mean 'robot/imu'?"));
  EXPECT_THAT(fault({make("gyro", {"site", "imu", "robt"})}),
              HasSubstr("no site named 'robt/imu'; did you mean 'robot/imu'"));
  EXPECT_THAT(fault({make("jointpos", in_robot("joint", "ball"))}), HasSubstr("robot/s"));
  EXPECT_THAT(fault({make("jointpos", in_robot("joint", "ball"))}), HasSubstr("slide or hinge"));
  EXPECT_THAT(fault({make("gyro", in_robot("site", "imu"))}, "<gyro name='s' site='imu'/>"),
              HasSubstr("sensor 'robot/s': defined in both entity XML and scene config"));
  EXPECT_THAT(fault({make("clock"), make("clock")}),
              HasSubstr("sensor 's': already exists in the scene"));
}

TEST(BuiltinSensor, DeclaresUnitAndFrame) {
  std::vector<BuiltinSensorCfg> sensors;
  const auto add = [&](const std::string& type, scene::ObjRef obj, scene::ObjRef ref = {}) {
    sensors.push_back(make(type, std::move(obj), std::move(ref)));
    sensors.back().name = std::to_string(sensors.size());
  };
  add("gyro", in_robot("site", "imu"));
  add("jointvel", in_robot("joint", "slide"));
  add("jointactuatorfrc", in_robot("joint", "hinge"));
  add("framepos", in_robot("body", "hand"), in_robot("site", "imu"));
  add("framelinacc", in_robot("body", "hand"), in_robot("site", "imu"));
  Bench bench(with(sensors));
  const auto spec = [&](int i) {
    return bench.scene().sensor("robot/" + std::to_string(i)).field().spec;
  };
  EXPECT_EQ(spec(1).unit, "rad/s");
  EXPECT_EQ(spec(1).frame, "site robot/imu");
  EXPECT_EQ(spec(1).name, "robot/1");
  EXPECT_EQ(spec(2).unit, "m/s");
  EXPECT_EQ(spec(3).unit, "N m");
  EXPECT_EQ(spec(4).frame, "site robot/imu");
  EXPECT_EQ(spec(5).frame, "world");
}

// Bounds of the values. The policy's space and the checks of recordings use them.
TEST(BuiltinSensor, DeclaresBounds) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  struct Case {
    const char* type;
    scene::ObjRef obj, ref;
    double cutoff, low, high;
  };
  const std::vector<Case> cases = {
      {"gyro", in_robot("site", "imu"), {}, 0, -kNone, kNone},
      {"gyro", in_robot("site", "imu"), {}, 0.5, -0.5, 0.5},
      {"touch", in_robot("site", "imu"), {}, 0, 0, kNone},
      {"touch", in_robot("site", "imu"), {}, 5, 0, 5},
      {"framezaxis", in_robot("body", "hand"), {}, 0, -1, 1},
      {"framequat", in_robot("body", "hand"), {}, 0, -1, 1},
      {"insidesite", in_robot("body", "hand"), in_robot("site", "imu"), 0, 0, 1}};
  std::vector<BuiltinSensorCfg> sensors;
  for (const Case& c : cases) {
    sensors.push_back(make(c.type, c.obj, c.ref));
    sensors.back().name = std::to_string(sensors.size());
    sensors.back().cutoff = c.cutoff;
  }
  Bench bench(with(sensors));
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const SensorSpec& spec = bench.scene().sensor("robot/" + std::to_string(i + 1)).field().spec;
    EXPECT_EQ(spec.low, cases[i].low) << cases[i].type << " " << cases[i].cutoff;
    EXPECT_EQ(spec.high, cases[i].high) << cases[i].type << " " << cases[i].cutoff;
  }
}

// The history field is that of MuJoCo's own reader of the buffer, before and after the buffer wraps
// around.
TEST(BuiltinSensor, HistoryIsNewestFirst) {
  BuiltinSensorCfg cfg = make("jointpos", in_robot("joint", "hinge"));
  cfg.nsample = 3;
  cfg.delay = .004;
  Bench bench(with({cfg}));
  const mjModel* m = bench.model();
  mjData* d = bench.data();
  d->qvel[6] = 2;
  std::vector<float> taken{0, 0, 0};
  for (int k = 0; k < 8; ++k) {
    mj_forward(m, d);
    EXPECT_THAT(bench.read("robot/s", "history"),
                ::testing::ElementsAre(taken[0], taken[1], taken[2]))
        << k;
    EXPECT_EQ(bench.read("robot/s")[0], taken[1]) << k;  // 0.004 s are 2 steps
    const int id = mj_name2id(m, mjOBJ_SENSOR, "robot/s");
    const mjtNum* newest =
        mj_readSensor(m, d, id, d->time + .004 - .5 * m->opt.timestep, nullptr, 0);
    EXPECT_EQ(bench.read("robot/s", "history")[0], static_cast<float>(*newest)) << k;
    taken.insert(taken.begin(), static_cast<float>(d->qpos[7]));
    mj_step(m, d);
  }
}

// In a simulation, after each control step, the rows are those of a plain mj_step loop followed by
// mj_forward. This includes delays and intervals, which use MuJoCo's history buffer.
TEST(BuiltinSensor, SimulationRowsAreCurrent) {
  const std::vector<Case> cases = all_cases();
  std::string sensors;
  for (const Case& c : cases) sensors += c.xml;
  auto scene = std::make_shared<scene::Scene>(with({}, sensors));
  sim::Simulation simulation(scene, {.num_worlds = 3, .decimation = 3, .threads = 2});
  const mjModel* m = scene->model();
  DataPtr data(mj_makeData(m));
  for (int k = 0; k < 6; ++k) {
    for (int w = 0; w < 3; ++w) {
      const ArrayView ctrl = simulation.worlds().state_component("ctrl");
      auto* row = reinterpret_cast<double*>(ctrl.data + w * ctrl.strides[0]);
      for (int i = 0; i < m->nu; ++i) row[i] = data->ctrl[i] = .3 * std::sin(k + i);
    }
    simulation.step();
    for (int i = 0; i < 3; ++i) mj_step(m, data.get());
    mj_forward(m, data.get());
    for (const auto& sensor : scene->sensors()) {
      simulation.refresh(*sensor);
      const int id = mj_name2id(m, mjOBJ_SENSOR, sensor->name().c_str());
      for (int w = 0; w < 3; ++w) {
        const auto row = sensor->field().data.row<float>(w);
        for (std::size_t i = 0; i < row.size(); ++i) {
          EXPECT_FLOAT_EQ(row[i], static_cast<float>(data->sensordata[m->sensor_adr[id] + i]))
              << sensor->name() << " " << k << " " << w;
        }
      }
    }
  }
}

}  // namespace
}  // namespace mjsense::sensors
