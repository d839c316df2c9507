// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/scene.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "mjsense/core/error.h"
#include "mjsense/core/pose.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/scene/physics_options.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kRobot = R"(<mujoco><option timestep="0.01"/><worldbody>
  <geom name="floor" type="plane" size="1 1 1"/>
  <body name="base" pos="0 0 1"><freejoint/><geom size=".1"/><site name="imu"/>
    <body name="arm"><joint name="shoulder" ref="90"/><geom name="arm" size=".1"/></body></body></worldbody>
  <actuator><motor name="m" joint="shoulder"/></actuator>
  <sensor><gyro name="g" site="imu"/><accelerometer site="imu"/></sensor></mujoco>)";
constexpr const char* kTable = R"(<mujoco><worldbody><geom name="top" type="box" size="1 1 .1"/>
  <body name="drawer"><joint name="slide" type="slide"/><geom size=".1"/></body></worldbody>
  <keyframe><key qpos=".25"/></keyframe></mujoco>)";

EntityCfg xml(const char* text) { return {.model = {.xml = text}}; }

TEST(Scene, AttachesWithPrefixesInOrder) {
  SceneCfg cfg;
  cfg.terrain.emplace();
  cfg.entities = {{"robot", xml(kRobot)}, {"table", xml(kTable)}};
  Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  EXPECT_STREQ(mj_id2name(m, mjOBJ_BODY, 1), "terrain");
  EXPECT_THAT(scene.entity("robot").body_names, ElementsAre("base", "arm"));
  EXPECT_THAT(scene.entity("robot").geom_names, ElementsAre("floor", "geom_1", "arm"));
  EXPECT_THAT(scene.entity("robot").joint_names, ElementsAre("floating_base_joint", "shoulder"));
  EXPECT_THAT(scene.entity("table").body_names, ElementsAre("mocap_base", "drawer"));
  EXPECT_THAT(scene.entity("terrain").geom_names, ElementsAre("terrain"));
  EXPECT_EQ(m->nmocap, 1);
  ASSERT_EQ(m->nkey, 1);
  EXPECT_THAT(std::vector<double>(m->key_qpos, m->key_qpos + m->nq),
              ElementsAre(0, 0, 0, 1, 0, 0, 0, 0, .25));
  EXPECT_DOUBLE_EQ(m->qpos0[2], 1.0);
  EXPECT_DOUBLE_EQ(m->qpos0[7], M_PI / 2);
  EXPECT_DOUBLE_EQ(m->opt.timestep, 0.002);
  EXPECT_THAT(scene.warnings(), ElementsAre(HasSubstr("timestep")));
  ASSERT_EQ(scene.sensors().size(), 2u);
  EXPECT_EQ(scene.sensors()[0]->name(), "robot/g");
  EXPECT_EQ(scene.sensors()[1]->name(), "robot/sensor_1");
  EXPECT_THAT(scene.to_xml(), HasSubstr("init_state"));
}

std::string fault(SceneCfg cfg) {
  try {
    Scene{std::move(cfg)};
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

std::string fault(const std::string& name, EntityCfg entity) {
  SceneCfg cfg;
  cfg.entities = {{name, std::move(entity)}};
  return fault(std::move(cfg));
}

constexpr const char* kBall =
    "<mujoco><worldbody><body name='b'><freejoint/><geom size='.1'/></body></worldbody></mujoco>";

TEST(Scene, ErrorsNameTheEntity) {
  EXPECT_EQ(fault("a", {.model = {.path = "/nowhere/a.xml"}}),
            "entity 'a': no file '/nowhere/a.xml'");
  EXPECT_THAT(fault("a", {.model = {.path = "embedded:robots/franka/fr4.xml"}}),
              HasSubstr("franka/fr"));
  EXPECT_THAT(fault("a", {.model = {.path = "embedded:robots/q.xml"}}),
              HasSubstr("no embedded file named 'robots/q.xml'; available: robots/"));
  EXPECT_EQ(fault("a", {}), "entity 'a': no model; give a path or an XML text");
  EXPECT_THAT(fault("a", {.model = {.path = "x.xml", .xml = kBall}}), HasSubstr("not both"));
  EXPECT_THAT(fault("a", xml("<mujoco><worldbody><geom sise='1'/></worldbody></mujoco>")),
              HasSubstr("entity 'a': Schema violation: unrecognized attribute: 'sise'"));
  EXPECT_THAT(fault("a", xml("<mujoco><worldbody>")), HasSubstr("entity 'a': XML"));
  EXPECT_THAT(
      fault("a", xml("<mujoco><worldbody><body name='x'><joint/></body></worldbody></mujoco>")),
      HasSubstr("a/x"));
  EXPECT_THAT(
      fault("a", xml("<mujoco><asset><mesh file='none.obj'/></asset><worldbody/></mujoco>")),
      HasSubstr("none.obj"));
  EXPECT_EQ(fault("", xml(kBall)), "scene: an entity needs a name");
  EXPECT_EQ(fault("a/b", xml(kBall)), "entity 'a/b': '/' is not allowed in a name");
  EXPECT_THAT(fault("a", {.model = {.xml = kBall}, .quat = {0, 0, 0, 0}}),
              HasSubstr("not a rotation"));
  EXPECT_THAT(
      fault("a", {.model = {.xml = "<mujoco><worldbody><geom size='.1'/></worldbody></mujoco>"},
                  .quat = {0, 0, 0, 0},
                  .mocap_base = false}),
      HasSubstr("not a rotation"));
  EXPECT_THAT(
      fault("x", xml("<mujoco><worldbody><body name='a'><freejoint/><geom size='.1'/></body><body "
                     "name='b'><freejoint/><geom size='.1'/></body></worldbody></mujoco>")),
      HasSubstr(
          "entity 'x': its model has 2 freejoints ('floating_base_joint', 'floating_base_joint_'"));
  EXPECT_EQ(fault("a", {.model = {.xml = kRobot}, .joint_pos = {{"sholder", 1}}}),
            "entity 'a': joint_pos: 'sholder' matches no hinge or slide; did you mean 'shoulder'?");
  SceneCfg twice;
  twice.entities = {{"a", xml(kBall)}, {"a", xml(kBall)}};
  EXPECT_EQ(fault(std::move(twice)), "entity 'a': two entities have this name");
  SceneCfg terrain;
  terrain.terrain.emplace();
  terrain.entities = {{"terrain", xml(kBall)}};
  EXPECT_EQ(fault(std::move(terrain)),
            "entity 'terrain': the name is reserved for the scene's terrain");
}

// MuJoCo compiles these models; at most it warns that there is a NaN.
TEST(Scene, RejectsInvalidNumbers) {
  const auto base_fault = [](const std::string& inside) {
    SceneCfg cfg;
    cfg.base.xml = "<mujoco>" + inside + "</mujoco>";
    return fault(std::move(cfg));
  };
  EXPECT_EQ(
      base_fault(
          R"(<worldbody><body name="b" pos="nan 0 0"><freejoint/><geom size=".1"/></body></worldbody>)"),
      "scene: body_pos of body 'b' is nan: must be finite");
  EXPECT_EQ(base_fault(R"(<worldbody><camera name="eye" fovy="nan"/></worldbody>)"),
            "scene: cam_fovy of camera 'eye' is nan: must be finite");
  EXPECT_EQ(base_fault(R"(<worldbody><site name="s" pos="inf 0 0"/></worldbody>)"),
            "scene: site_pos of site 's' is inf: must be finite");
  for (const char* wrong : {"nan", "0", "-1", "inf"})
    EXPECT_THAT(base_fault(fmt::format(
                    R"(<option timestep="{}"/><worldbody><geom size=".1"/></worldbody>)", wrong)),
                HasSubstr(fmt::format("scene: timestep is {}: must be a positive", wrong)));
  EXPECT_EQ(
      base_fault(R"(<size nuser_body="1"/><worldbody><body name="b" user="nan"/></worldbody>)"),
      "no error");

  SceneCfg cfg;
  cfg.base.xml =
      R"(<mujoco><option timestep="10"/><worldbody><geom size=".1"/></worldbody></mujoco>)";
  EXPECT_THAT(Scene(std::move(cfg)).warnings(),
              ElementsAre(HasSubstr("a timestep of 10 s is long")));
}

TEST(Scene, ErrorsNameTheOption) {
  const auto option_fault = [](const std::function<void(OptionsCfg&)>& edit) {
    SceneCfg cfg;
    edit(cfg.options);
    return fault(std::move(cfg));
  };
  EXPECT_EQ(option_fault([](OptionsCfg& o) { o.integrator = "euler"; }), "no error");
  EXPECT_THAT(option_fault([](auto& o) { o.timestep = 0; }),
              HasSubstr("options: timestep is 0: must be above 0"));
  EXPECT_EQ(option_fault([](auto& o) { o.disableflags = {"contacts"}; }),
            "options: disableflags has no flag 'contacts'; did you mean 'contact'?");
  EXPECT_THAT(option_fault([](auto& o) { o.enableflags = {"contact"}; }),
              HasSubstr("no flag 'contact'"));
  for (int i = 0; i < mjNDISABLE; ++i) {  // all flag names of MJCF must be accepted
    SceneCfg cfg;
    std::string name = mjDISABLESTRING[i];
    std::transform(name.begin(), name.end(), name.begin(), ::tolower);
    cfg.options.disableflags = {name};
    const Scene scene(std::move(cfg));
    EXPECT_EQ(scene.model()->opt.disableflags, 1 << i) << name;
    EXPECT_THAT(scene.to_xml(), HasSubstr(name + "=\"disable\""));
  }
}

TEST(Scene, LooksUpWithNearestNames) {
  SceneCfg cfg;
  cfg.entities = {{"robot", xml(kRobot)}};
  Scene scene(std::move(cfg));
  EXPECT_EQ(scene.sensor("robot/g").name(), "robot/g");
  EXPECT_EQ(scene.find_sensor("g"), nullptr);
  try {
    scene.sensor("g");
    FAIL();
  } catch (const KeyError& error) {
    EXPECT_STREQ(error.what(), "scene: sensor 'g' not found; did you mean 'robot/g'?");
  }
  EXPECT_THROW(scene.entity("robt"), KeyError);
  const ResolvedObj site =
      resolve(scene.model(), &scene, {.type = "site", .name = "imu", .entity = "robot"}, "test");
  EXPECT_EQ(name_of(scene.model(), site.type, site.id), "robot/imu");
  const auto fault_of = [&](ObjRef ref) -> std::string {
    return error_of([&] { resolve(scene.model(), &scene, ref, "sensor 's'"); });
  };
  EXPECT_EQ(fault_of({"site", "imu", "robo"}),
            "sensor 's': no entity named 'robo'; did you mean 'robot'?");
  EXPECT_EQ(fault_of({"site", "imi", "robot"}),
            "sensor 's': no site named 'robot/imi'; did you mean 'robot/imu'?");
  EXPECT_THAT(fault_of({"sight", "imu", "robot"}), HasSubstr("unknown object type 'sight'"));
}

TEST(Scene, PlacesEntities) {
  SceneCfg cfg;
  const std::array<double, 3> pos{1, 2, 3};
  const std::array<double, 4> quat{2, 2, 0, 0};
  cfg.entities = {
      {"ball", {.model = {.xml = kBall}, .pos = pos, .quat = quat}},
      {"table", {.model = {.xml = kTable}, .pos = pos, .quat = quat}},
      {"post",
       {.model = {.xml = "<mujoco><worldbody><geom name='g' size='.1'/></worldbody></mujoco>"},
        .pos = pos,
        .mocap_base = false}},
      {"robot", {.model = {.xml = kRobot}, .joint_pos = {{"should.*", .5}, {".*", .7}}}}};
  cfg.entities[3].second.joint_pos.pop_back();
  Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  EXPECT_THAT(std::vector<double>(m->qpos0, m->qpos0 + 3), ElementsAre(1, 2, 3));
  EXPECT_THAT(std::vector<double>(m->key_qpos, m->key_qpos + 3), ElementsAre(1, 2, 3));
  EXPECT_NEAR(m->key_qpos[4], std::sqrt(.5), 1e-12);
  const int base = mj_name2id(m, mjOBJ_BODY, "table/mocap_base");
  EXPECT_THAT(std::vector<double>(m->body_pos + 3 * base, m->body_pos + 3 * base + 3),
              ElementsAre(1, 2, 3));
  EXPECT_NEAR(m->body_quat[4 * base + 1], std::sqrt(.5), 1e-12);
  EXPECT_EQ(m->body_mocapid[base], 0);
  const int post = mj_name2id(m, mjOBJ_GEOM, "post/g");
  EXPECT_EQ(m->geom_bodyid[post], 0);
  EXPECT_THAT(std::vector<double>(m->geom_pos + 3 * post, m->geom_pos + 3 * post + 3),
              ElementsAre(1, 2, 3));
  EXPECT_EQ(m->key_qpos[m->nq - 1], .5);
}

// Patterns are tried in order; the first one that matches a joint gives its position.
TEST(Scene, FirstMatchingJointPatternWins) {
  const char* leg = R"(<mujoco><worldbody><body><joint name="hip"/><geom size=".1"/>
    <body><joint name="knee"/><geom size=".1"/><body><joint name="foot" type="slide" axis="0 0 1"/>
    <geom size=".1"/></body></body></body></worldbody></mujoco>)";
  const auto start = [&](std::vector<std::pair<std::string, double>> joint_pos) {
    SceneCfg cfg;
    cfg.entities = {{"leg", {.model = {.xml = leg}, .joint_pos = std::move(joint_pos)}}};
    Scene scene(std::move(cfg));
    const mjModel* m = scene.model();
    return std::vector<double>(m->key_qpos, m->key_qpos + m->nq);
  };
  EXPECT_THAT(start({{"knee", .5}, {".*", .1}}), ElementsAre(.1, .5, .1));
  EXPECT_THAT(start({{"h.*|k.*", .2}, {"knee", .5}, {"foot", -.3}}), ElementsAre(.2, .2, -.3));
  EXPECT_THAT(start({{"foot", .7}}), ElementsAre(0, 0, .7));
}

TEST(Scene, JoinsMocapKeyframes) {
  const char* hand =
      R"(<mujoco><worldbody><body name="hand" mocap="true" pos="1 2 3"><geom size=".1"/></body>
    </worldbody><keyframe><key mpos="4 5 6" mquat="0 1 0 0"/></keyframe></mujoco>)";
  SceneCfg cfg;
  cfg.entities = {{"table", xml(kTable)}, {"hand", xml(hand)}};
  Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  ASSERT_EQ(m->nmocap, 2);  // the table's mocap base and the hand
  EXPECT_THAT(std::vector<double>(m->key_mpos + 3, m->key_mpos + 6), ElementsAre(4, 5, 6));
  EXPECT_THAT(std::vector<double>(m->key_mquat + 4, m->key_mquat + 8), ElementsAre(0, 1, 0, 0));
}

TEST(Scene, EveryOptionIsApplied) {
  SceneCfg cfg;
  cfg.options.timestep = 0.003;
  cfg.options.integrator = "rk4";
  cfg.options.cone = "elliptic";
  cfg.options.solver = "cg";
  cfg.options.jacobian = "sparse";
  cfg.options.impratio = 7;
  cfg.options.iterations = 31;
  cfg.options.tolerance = 1e-7;
  cfg.options.ls_iterations = 17;
  cfg.options.ls_tolerance = 0.02;
  cfg.options.ccd_iterations = 23;
  cfg.options.gravity = {1, 2, 3};
  cfg.options.magnetic = {4, 5, 6};
  cfg.options.wind = {7, 8, 9};
  cfg.options.density = 1.2;
  cfg.options.viscosity = 0.1;
  cfg.options.disableflags = {"contact"};
  cfg.options.enableflags = {"energy"};
  cfg.entities = {{"ball", xml(kBall)}};
  Scene scene(std::move(cfg));
  const mjOption& o = scene.model()->opt;
  const double numbers[] = {o.timestep,   o.impratio,    o.tolerance,   o.ls_tolerance,
                            o.density,    o.viscosity,   o.gravity[0],  o.gravity[1],
                            o.gravity[2], o.magnetic[0], o.magnetic[1], o.magnetic[2],
                            o.wind[0],    o.wind[1],     o.wind[2]};
  EXPECT_THAT(numbers, ElementsAre(0.003, 7, 1e-7, 0.02, 1.2, 0.1, 1, 2, 3, 4, 5, 6, 7, 8, 9));
  EXPECT_EQ(o.integrator, mjINT_RK4);
  EXPECT_EQ(o.cone, mjCONE_ELLIPTIC);
  EXPECT_EQ(o.solver, mjSOL_CG);
  EXPECT_EQ(o.jacobian, mjJAC_SPARSE);
  EXPECT_EQ(o.iterations, 31);
  EXPECT_EQ(o.ls_iterations, 17);
  EXPECT_EQ(o.ccd_iterations, 23);
  EXPECT_EQ(o.disableflags, mjDSBL_CONTACT);
  EXPECT_EQ(o.enableflags, mjENBL_ENERGY);
}

TEST(Scene, OptionsCanChangeUntilASimulationHasTheScene) {
  SceneCfg cfg;
  cfg.entities = {{"ball", xml(kBall)}};
  Scene scene(std::move(cfg));
  OptionsCfg options;
  options.timestep = 0.004;
  scene.set_options(options);
  EXPECT_EQ(scene.model()->opt.timestep, 0.004);
  EXPECT_EQ(scene.cfg().options.timestep, 0.004);
  const std::shared_ptr<void> claim = scene.claim();
  EXPECT_THROW(scene.set_options({}), RuntimeError);
}

// The options of an entity that the scene would override are named to the user: none may be missing.
TEST(Options, EachDifferenceIsNamed) {
  mjOption standard;
  mj_defaultOption(&standard);
  EXPECT_THAT(differing_options(standard, standard), ElementsAre());
  mjOption option = standard;
  option.sleep_tolerance += 1;
  EXPECT_THAT(differing_options(option, standard), ElementsAre("sleep_tolerance"));
  option.gravity[2] += 1;
  option.sdf_iterations += 1;
  EXPECT_THAT(differing_options(option, standard),
              ElementsAre("sleep_tolerance", "gravity", "sdf_iterations"));
}

TEST(Scene, JoinsKeyframes) {
  const char* legged =
      "<mujoco><worldbody><body><freejoint/><geom size='.1'/><body><joint name='j' range='-9 "
      "9'/><geom size='.1'/>"
      "</body></body></worldbody><actuator><general joint='j' dyntype='integrator' "
      "name='a'/><motor joint='j'/></actuator>"
      "<keyframe><key name='home' qpos='1 2 3 0 1 0 0 .4' qvel='1 2 3 4 5 6 7' act='.5' ctrl='.6 "
      ".7'/><key "
      "name='other'/></keyframe></mujoco>";
  SceneCfg cfg;
  cfg.entities = {
      {"table", xml(kTable)}, {"one", xml(legged)}, {"robot", xml(kRobot)}, {"two", xml(legged)}};
  Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  ASSERT_EQ(m->nkey, 1);
  EXPECT_STREQ(mj_id2name(m, mjOBJ_KEY, 0), "init_state");
  EXPECT_THAT(
      std::vector<double>(m->key_qpos, m->key_qpos + m->nq),
      ElementsAre(.25, 1, 2, 3, 0, 1, 0, 0, .4, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2, 3, 0, 1, 0, 0, .4));
  EXPECT_THAT(std::vector<double>(m->key_ctrl, m->key_ctrl + m->nu),
              ElementsAre(.6, .7, 0, .6, .7));
  EXPECT_THAT(std::vector<double>(m->key_act, m->key_act + m->na), ElementsAre(.5, .5));
  EXPECT_THAT(std::vector<double>(m->key_qvel, m->key_qvel + 8),
              ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(scene.warnings(), ::testing::Contains(HasSubstr("entity 'one': 2 keyframes")));
}

// The base's keyframes by name and number, with the first keyframe of the entity in each.
TEST(Scene, ABaseKeepsItsKeyframes) {
  SceneCfg cfg;
  cfg.base.xml =
      "<mujoco><worldbody><body name='a'><joint name='x' type='slide'/><geom size='.1'/></body>"
      "</worldbody><keyframe><key name='home' time='.5' qpos='1'/><key time='1.5' qpos='2'/>"
      "<key name='away' qpos='3'/></keyframe></mujoco>";
  cfg.entities = {{"table", xml(kTable)}};
  const Scene scene(std::move(cfg));
  const auto check = [](const mjModel* m) {
    ASSERT_EQ(m->nkey, 4);
    EXPECT_EQ(mj_name2id(m, mjOBJ_KEY, "home"), 0);
    EXPECT_EQ(mj_name2id(m, mjOBJ_KEY, "away"), 2);
    EXPECT_EQ(mj_name2id(m, mjOBJ_KEY, "init_state"), 3);
    EXPECT_THAT(std::vector<double>(m->key_time, m->key_time + 4), ElementsAre(.5, 1.5, 0, .5));
    EXPECT_THAT(std::vector<double>(m->key_qpos, m->key_qpos + 4 * m->nq),
                ElementsAre(1, .25, 2, .25, 3, .25, 1, .25));
  };
  check(scene.model());
  EXPECT_THAT(scene.warnings(), ::testing::IsEmpty());
  SceneCfg saved;  // whose init_state is the scene's
  saved.base.xml = scene.to_xml();
  check(Scene(std::move(saved)).model());
}

// Two instances of a model stand where they were put, in their keyframe too.
TEST(Scene, AKeyframeMovesWithItsEntity) {
  const char* legged =
      "<mujoco><worldbody><body pos='0 0 .3'><freejoint/><geom size='.1'/></body></worldbody>"
      "<keyframe><key qpos='.1 0 .25 1 0 0 0' qvel='1 0 0 0 0 2'/></keyframe></mujoco>";
  const double half = std::sqrt(.5);
  EntityCfg moved = xml(legged), turned = xml(legged);
  moved.pos = {1, 2, .3};
  turned.pos = {0, 5, .3};
  turned.quat = {half, 0, 0, half};
  SceneCfg cfg;
  cfg.entities = {{"as_it_is", xml(legged)}, {"moved", moved}, {"turned", turned}};
  const Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  const double qpos[] = {.1, 0, .25, 1, 0,   0,   0,    1.1, 2, .25, 1,
                         0,  0, 0,   0, 5.1, .25, half, 0,   0, half};
  const double qvel[] = {1, 0, 0, 0, 0, 2, 1, 0, 0, 0, 0, 2, 0, 1, 0, 0, 0, 2};
  ASSERT_EQ(m->nq, 21);
  for (int i = 0; i < m->nq; ++i) EXPECT_NEAR(m->key_qpos[i], qpos[i], 1e-15) << i;
  for (int i = 0; i < m->nv; ++i) EXPECT_NEAR(m->key_qvel[i], qvel[i], 1e-15) << i;
}

TEST(Scene, AMocapKeyframeMovesWithItsEntity) {
  EntityCfg hand =
      xml("<mujoco><worldbody><body name='hand' mocap='true' pos='0 0 1'><geom size='.1'/></body>"
          "</worldbody><keyframe><key mpos='0 0 1.5' mquat='1 0 0 0'/></keyframe></mujoco>");
  hand.pos = {3, 0, 1};
  SceneCfg cfg;
  cfg.entities = {{"hand", hand}};
  const Scene scene(std::move(cfg));
  EXPECT_THAT(std::vector<double>(scene.model()->key_mpos, scene.model()->key_mpos + 3),
              ElementsAre(3, 0, 1.5));
}

// Frames about the root, by quaternion and by Euler angles: pos and quat are of the root in the world.
TEST(Scene, RootInAFrameHasTheConfiguredPose) {
  const char* framed =
      "<mujoco><worldbody><frame pos='1 0 0' euler='0 0 90'><frame pos='0 0 2'>"
      "<body name='root' pos='.5 0 0' euler='90 0 0'><freejoint/><geom size='.1'/></body>"
      "</frame></frame></worldbody><keyframe><key qpos='1 .5 2.5 1 0 0 0'/></keyframe></mujoco>";
  EntityCfg put = xml(framed);
  put.pos = {4, 5, 6};
  put.quat = {0, 1, 0, 0};
  SceneCfg cfg;
  cfg.entities = {{"r", put}};
  const Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  const double wanted[] = {4, 5, 6, 0, 1, 0, 0};
  for (int i = 0; i < 7; ++i) EXPECT_NEAR(m->qpos0[i], wanted[i], 1e-12) << i;
  // In its own model the root stands at (1, .5, 2), turned by 90 degrees about z, then about x; the
  // keyframe, half a metre above it, is not turned.
  const Pose own{{1, .5, 2}, quat_from_columns({0, 1, 0}, {0, 0, 1}, {1, 0, 0})};
  const Pose key = Pose{{4, 5, 6}, {0, 1, 0, 0}} * (inverse(own) * Pose{{1, .5, 2.5}, {}});
  EXPECT_LT(norm(vec3(m->key_qpos) - key.p), 1e-12);
  EXPECT_LT(angle_between(quat(m->key_qpos + 3), key.q), 1e-7);
}

TEST(Scene, SpecFnIsCalledLast) {
  SceneCfg cfg;
  cfg.entities = {{"robot", xml(kRobot)}};
  cfg.extent = 4;
  cfg.spec_fn = [](mjSpec* spec) {
    mjsSite* site = mjs_addSite(mjs_findBody(spec, "robot/arm"), nullptr);
    mjs_setName(site->element, "extra");
    mjsSensor* sensor = mjs_addSensor(spec);
    mjs_setName(sensor->element, "late");
    sensor->type = mjSENS_CLOCK;
    spec->option.timestep = .004;
  };
  Scene scene(std::move(cfg));
  EXPECT_GE(mj_name2id(scene.model(), mjOBJ_SITE, "extra"), 0);
  EXPECT_EQ(scene.model()->opt.timestep, .004);
  EXPECT_EQ(scene.model()->stat.extent, 4);
  EXPECT_FLOAT_EQ(scene.model()->stat.meansize, .03);
  EXPECT_EQ(scene.find_sensor("late"), nullptr);
}

// A complete model used unchanged, with two free bodies and a keyframe, plus an entity.
TEST(Scene, Base) {
  SceneCfg cfg;
  cfg.base.xml =
      "<mujoco><option timestep='.005' integrator='RK4'/><worldbody><geom type='plane' size='1 1 "
      "1'/><body name='a'><freejoint/><geom "
      "size='.1'/></body><body "
      "name='b'><freejoint/><geom size='.1'/><site name='s'/></body></worldbody><sensor><gyro "
      "site='s'/></sensor>"
      "<keyframe><key qpos='1 2 3 1 0 0 0 4 5 6 1 0 0 0'/></keyframe></mujoco>";
  cfg.entities = {{"table", xml(kTable)}};
  Scene scene(std::move(cfg));
  const mjModel* m = scene.model();
  EXPECT_GE(mj_name2id(m, mjOBJ_BODY, "a"), 0);
  EXPECT_EQ(m->njnt, 3);
  EXPECT_THAT(std::vector<double>(m->key_qpos, m->key_qpos + m->nq),
              ElementsAre(1, 2, 3, 1, 0, 0, 0, 4, 5, 6, 1, 0, 0, 0, .25));
  EXPECT_EQ(scene.sensors().at(0)->name(), "sensor_0");
  EXPECT_EQ(scene.entities().size(), 1u);
  EXPECT_EQ(m->opt.timestep, .005);
  EXPECT_EQ(m->opt.integrator, mjINT_RK4);
  SceneCfg other = scene.cfg();
  other.options.gravity = {0, 0, -1};
  const Scene moon(std::move(other));
  EXPECT_EQ(moon.model()->opt.gravity[2], -1);
  EXPECT_EQ(moon.model()->opt.timestep, .002);
}

TEST(Scene, KeepsMocapBodiesInTheWorld) {
  SceneCfg cfg;
  cfg.entities = {
      {"lab", xml("<mujoco><worldbody><body name='post'><geom size='.1'/></body><body name='hand' "
                  "mocap='true'/>"
                  "</worldbody></mujoco>")},
      {"tracker", xml("<mujoco><worldbody><body name='t' mocap='true'/></worldbody></mujoco>")}};
  Scene scene(std::move(cfg));
  EXPECT_THAT(scene.entity("lab").body_names, ElementsAre("post", "hand"));
  EXPECT_THAT(scene.entity("tracker").body_names, ElementsAre("t"));
  EXPECT_TRUE(scene.entity("lab").fixed_base);
  EXPECT_THAT(scene.warnings(), ElementsAre(HasSubstr("entity 'lab': stays on the world body")));
}

TEST(Scene, UsesVisualSettingsOfTheFirstEntity) {
  SceneCfg cfg;
  cfg.entities = {
      {"a", xml("<mujoco><visual><map znear='.5'/></visual><size nuserdata='3'/></mujoco>")},
      {"b", xml("<mujoco><visual><map znear='.25'/><headlight ambient='.5 .5 .5'/></visual>"
                "<size nuserdata='7'/></mujoco>")}};
  Scene scene(std::move(cfg));
  EXPECT_FLOAT_EQ(scene.model()->vis.map.znear, .5f);
  EXPECT_FLOAT_EQ(scene.model()->vis.headlight.ambient[0], .5f);
  EXPECT_EQ(scene.model()->nuserdata, 7);
  EXPECT_THAT(scene.warnings(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace mjsense::scene
