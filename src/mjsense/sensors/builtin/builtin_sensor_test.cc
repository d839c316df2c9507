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
#include "mjsense/core/rng.h"
#include "mjsense/scene/scene.h"
#include "mjsense/scene/spec.h"
#include "mjsense/sensors/builtin/builtin_types.h"

namespace mjsense {
namespace {

using ::testing::HasSubstr;

struct DataDelete {
  void operator()(mjData* data) const { mj_deleteData(data); }
};
using DataPtr = std::unique_ptr<mjData, DataDelete>;

// A robot with one of everything a sensor can be attached to. `sensors` are its XML's.
std::string robot(const std::string& sensors) {
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

ObjRef in_robot(const std::string& type, const std::string& name) { return {type, name, "robot"}; }

std::vector<Case> all_cases() {
  std::vector<Case> cases;
  const auto add = [&](const std::string& type, const std::string& attributes, ObjRef obj,
                       ObjRef ref = {}) -> Case& {
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
      // The accelerations accept a ref and ignore it; MJCF does not accept it.
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

class Bench {
 public:
  explicit Bench(SceneCfg cfg) : scene_(std::move(cfg)), data_(mj_makeData(scene_.model())) {
    for (const auto& sensor : scene_.sensors()) sensor->initialize({scene_.model(), &scene_, 2});
  }
  const mjModel* model() const { return scene_.model(); }
  mjData* data() { return data_.get(); }
  Scene& scene() { return scene_; }

  // Row 1 of 2 (row 0 must stay zero).
  std::vector<float> read(const std::string& key, const std::string& field = "") {
    Sensor& sensor = scene_.sensor(key);
    sensor.compute({.id = 1, .model = model(), .data = data()});
    const auto row = sensor.field(field).data.row<float>(1);
    for (float x : sensor.field(field).data.row<float>(0)) EXPECT_EQ(x, 0.0f);
    return {row.begin(), row.end()};
  }

 private:
  Scene scene_;
  DataPtr data_;
};

void randomize(const mjModel* m, mjData* d, Rng& rng) {
  for (int i = 0; i < m->nq; ++i) d->qpos[i] = m->qpos0[i] + rng.uniform(-.3, .3);
  mj_normalizeQuat(m, d->qpos);
  for (int i = 0; i < m->nv; ++i) d->qvel[i] = rng.uniform(-2, 2);
  for (int i = 0; i < m->nu; ++i) d->ctrl[i] = rng.uniform(-1, 1);
}

// Configured sensors, discovered ones, and MuJoCo alone on the same XML: the same numbers.
TEST(BuiltinSensor, EveryTypeAgreesWithMujoco) {
  const std::vector<Case> cases = all_cases();
  std::string sensors;
  SceneCfg cfg;
  for (const Case& c : cases) {
    sensors += c.xml;
    cfg.sensors.push_back(std::make_shared<BuiltinSensorCfg>(c.cfg));
  }
  cfg.entities = {{"robot", {.model = {.xml = robot(sensors)}}}};
  Bench bench(std::move(cfg));

  // The same physics, without mjsense: prefixes are the only difference.
  char error[1000] = "";
  SpecPtr spec(mj_parseXMLString(robot(sensors).c_str(), nullptr, error, sizeof error));
  ASSERT_TRUE(spec) << error;
  spec->option = bench.model()->opt;
  ModelPtr plain(mj_compile(spec.get(), nullptr));
  ASSERT_TRUE(plain);
  DataPtr data(mj_makeData(plain.get()));

  std::set<std::string> types, moved;
  for (int trial = 0; trial < 20; ++trial) {
    Rng a(trial, 0, 0, 0), b(trial, 0, 0, 0);
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
      const auto& spec = bench.scene().sensor(c.cfg.key()).field().spec;
      for (std::size_t i = 0; i < configured.size(); ++i) {
        const float expected = static_cast<float>(data->sensordata[plain->sensor_adr[id] + i]);
        EXPECT_EQ(configured[i], expected) << local << " " << i;
        EXPECT_EQ(found[i], expected) << local << " " << i;
        EXPECT_GE(configured[i], spec.low - 1e-5) << local;
        EXPECT_LE(configured[i], spec.high + 1e-5) << local;
        if (expected != 0) moved.insert(c.cfg.sensor_type);
      }
      types.insert(c.cfg.sensor_type);
    }
  }
  for (const BuiltinType& type : builtin_types()) {
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

BuiltinSensorCfg make(const std::string& type, ObjRef obj = {}, ObjRef ref = {}) {
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
  const ObjRef site = in_robot("site", "imu");
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
  EXPECT_THAT(fault(make("gyro", site), [](auto& c) { c.interp = "spline"; }),
              HasSubstr("zoh, linear, cubic"));
  EXPECT_THAT(
      fault(make("gyro", site), [](auto& c) { c.nsample = 2, c.interval = .01, c.phase = -.01; }),
      HasSubstr("(-interval, 0]"));
  EXPECT_THAT(fault(make("rangefinder", site), [](auto& c) { c.data = {"range"}; }),
              HasSubstr("no field 'range'"));
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

SceneCfg with(std::vector<BuiltinSensorCfg> sensors, const std::string& xml = "") {
  SceneCfg cfg;
  cfg.entities = {{"robot", {.model = {.xml = robot(xml)}}}};
  for (auto& s : sensors) cfg.sensors.push_back(std::make_shared<BuiltinSensorCfg>(std::move(s)));
  return cfg;
}

TEST(BuiltinSensor, ErrorsOfTheSceneNameTheSensor) {
  const auto fault = [](std::vector<BuiltinSensorCfg> sensors, const std::string& xml = "") {
    return message_of([&] { Scene scene(with(std::move(sensors), xml)); });
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

TEST(BuiltinSensor, SaysUnitAndFrame) {
  std::vector<BuiltinSensorCfg> sensors;
  const auto add = [&](const std::string& type, ObjRef obj, ObjRef ref = {}) {
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

// The history field against MuJoCo's own reader of its buffer, before and after it wraps around.
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
    EXPECT_EQ(bench.read("robot/s")[0], taken[1]) << k;  // 0.004 s = 2 steps ago
    const int id = mj_name2id(m, mjOBJ_SENSOR, "robot/s");
    const mjtNum* newest =
        mj_readSensor(m, d, id, d->time + .004 - .5 * m->opt.timestep, nullptr, 0);
    EXPECT_EQ(bench.read("robot/s", "history")[0], static_cast<float>(*newest)) << k;
    taken.insert(taken.begin(), static_cast<float>(d->qpos[7]));
    mj_step(m, d);
  }
}

}  // namespace
}  // namespace mjsense
