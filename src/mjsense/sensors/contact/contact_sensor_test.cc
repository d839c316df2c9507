// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/testing/lab.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kBox[] = R"(
<mujoco><worldbody>
  <body name="ground"><geom name="ground_geom" type="plane" size="5 5 .1"/></body>
  <body name="box" pos="0 0 .5"><freejoint name="bj"/>
    <geom name="box_geom" type="box" size=".1 .1 .1" mass="1"/></body>
</worldbody></mujoco>)";

ContactSensorCfg box_cfg(std::string pattern = "box_geom") {
  ContactSensorCfg cfg;
  cfg.name = "c";
  cfg.primary = {"geom", {std::move(pattern)}, "box", {}};
  return cfg;
}

// A scene with one entity and these contact sensors.
struct ContactLab : testing::Lab {
  ContactLab(std::string entity, std::string xml, std::vector<ContactSensorCfg> sensors,
             sim::SimulationCfg cfg = {})
      : Lab(std::move(entity), std::move(xml), shared(std::move(sensors)), cfg) {}

  ContactSensor& sensor(std::string_view name = "c") {
    return dynamic_cast<ContactSensor&>(scene->sensor(name));
  }
  std::vector<float> read(std::string_view field, std::string_view name = "c") {
    return Lab::read(field, name);
  }
};

TEST(Contact, BoxOnTheFloorPushesDownWithItsWeight) {
  ContactSensorCfg net = box_cfg(), slots = box_cfg();
  net.reduce = "netforce";
  net.fields = {"found", "force", "pos"};
  slots.name = "s";
  slots.fields = {"force", "normal", "tangent"};
  slots.global_frame = true;
  slots.num_slots = 4;
  ContactLab lab("box", kBox, {net, slots});
  lab.pose({0, 0, 0.1, 1, 0, 0, 0});
  lab.sim->forward();
  for (int i = 0; i < 1000; ++i) lab.sim->step();
  EXPECT_EQ(lab.read("found")[0], 4.0f);
  const std::vector<float> f = lab.read("force");
  EXPECT_NEAR(f[0], 0, 1e-4);
  EXPECT_NEAR(f[1], 0, 1e-4);
  EXPECT_NEAR(f[2], -9.81, 1e-3);
  const std::vector<float> g = lab.read("force", "s");
  EXPECT_NEAR(g[2] + g[5] + g[8] + g[11], -9.81, 1e-3);
  EXPECT_THAT(lab.sensor().primary_names(), ElementsAre("box_geom"));
}

// A box at rest is pushed along the floor with less force than friction can hold. Its force on the
// floor equals the push, along both tangents. In the contact frame the third axis is normal x
// tangent.
TEST(Contact, FrictionHoldsAlongBothTangents) {
  std::vector<ContactSensorCfg> sensors;
  for (const bool box : {true, false}) {
    for (const char* kind : {"net", "global", "local"}) {
      ContactSensorCfg c = box_cfg(box ? "box_geom" : "ground_geom");
      c.name = std::string(box ? "box_" : "ground_") + kind;
      c.fields = {"found", "force", "normal", "tangent"};
      c.num_slots = 4;
      c.global_frame = std::string(kind) == "global";
      if (std::string(kind) == "net") {
        c.reduce = "netforce";
        c.num_slots = 1;
      }
      c.friction_split = true;
      sensors.push_back(c);
    }
  }
  ContactLab lab("box", kBox, sensors);
  lab.pose({0, 0, 0.1, 1, 0, 0, 0});
  const ArrayView push = lab.sim->worlds().state_component("qfrc_applied");
  auto* f = reinterpret_cast<double*>(push.data);
  f[0] = 1.5;
  f[1] = -2.5;
  lab.sim->forward();
  lab.sim->step(1500);
  const double expected[3] = {1.5, -2.5, -9.81};
  for (const bool box : {true, false}) {
    const std::string side = box ? "box_" : "ground_";
    const double sign = box ? 1 : -1;
    const auto total = [&](const std::string& sensor, const char* field) {
      const std::vector<float> rows = lab.read(field, sensor);
      std::array<double, 3> sum{};
      for (std::size_t i = 0; i < rows.size(); ++i) sum[i % 3] += rows[i];
      return sum;
    };
    for (const char* kind : {"net", "global"}) {
      const auto force = total(side + kind, "force"), normal = total(side + kind, "normal_force"),
                 friction = total(side + kind, "friction_force");
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(force[k], sign * expected[k], 2e-2) << side << kind << k;
        EXPECT_NEAR(normal[k], k == 2 ? sign * expected[k] : 0, 2e-2) << side << kind << k;
        EXPECT_NEAR(friction[k], k == 2 ? 0 : sign * expected[k], 2e-2) << side << kind << k;
      }
    }
    const std::vector<float> local = lab.read("force", side + "local"),
                             global = lab.read("force", side + "global"),
                             n = lab.read("normal", side + "local"),
                             t = lab.read("tangent", side + "local"),
                             own = lab.read("friction_force", side + "local");
    ASSERT_EQ(lab.read("found", side + "local")[0], 4.0f);
    for (int i = 0; i < 12; i += 3) {
      const double b[3] = {n[i + 1] * t[i + 2] - n[i + 2] * t[i + 1],
                           n[i + 2] * t[i] - n[i] * t[i + 2], n[i] * t[i + 1] - n[i + 1] * t[i]};
      EXPECT_NEAR(n[i + 2], -sign, 1e-6);  // away from the primary
      EXPECT_GT(local[i], 0);              // a pressing force
      for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(local[i] * n[i + k] + local[i + 1] * t[i + k] + local[i + 2] * b[k],
                    global[i + k], 1e-5)
            << side << i;
      EXPECT_EQ(own[i], 0);
      EXPECT_EQ(own[i + 1], local[i + 1]);
      EXPECT_EQ(own[i + 2], local[i + 2]);
    }
  }
}

//  [top]     g
//  [middle]  the primary: pushed down by the top, held by the bottom
//  [bottom]
//  -------
TEST(Contact, MiddleOfAStackPushesBothWays) {
  std::vector<std::pair<std::string, double>> boxes = {
      {"bottom", 0.1}, {"middle", 0.3}, {"top", 0.5}};
  for (ContactReduce reduce :
       {ContactReduce::kMinDist, ContactReduce::kMaxForce, ContactReduce::kNone}) {
    scene::SceneCfg cfg;
    cfg.terrain = scene::TerrainCfg{};
    for (const auto& [name, z] : boxes) {
      scene::EntityCfg box;
      box.model.xml = "<mujoco><worldbody><body name='b' pos='0 0 " + std::to_string(z) +
                      "'><freejoint/><geom name='g' type='box' size='.1 .1 .1' mass='1'/></body>"
                      "</worldbody></mujoco>";
      cfg.entities.emplace_back(name, box);
    }
    auto on = [&](const std::string& other) {
      auto c = std::make_shared<ContactSensorCfg>();
      c->name = "on_" + other;
      c->primary = {"geom", {"g"}, "middle", {}};
      c->secondary = ContactMatch{"geom", {"g"}, other, {}};
      c->fields = {"force", "normal", "tangent"};
      c->reduce = reduce;
      c->num_slots = 4;
      c->global_frame = true;
      return c;
    };
    cfg.sensors = {on("top"), on("bottom")};
    auto all = on("bottom");
    all->name = "all";
    all->secondary.reset();
    all->num_slots = 8;
    cfg.sensors.push_back(all);
    auto scene = std::make_shared<scene::Scene>(std::move(cfg));
    sim::Simulation sim(scene, {});
    sim.step(1500);
    const auto sum_z = [&](const char* name) {
      sim.refresh(scene->sensor(name));
      double sum = 0;
      const auto f = scene->sensor(name).field("force").data.row<float>(0);
      for (std::size_t i = 2; i < f.size(); i += 3) sum += f[i];
      return sum;
    };
    EXPECT_NEAR(sum_z("on_top"), 9.81, 0.01) << enum_name(reduce);
    EXPECT_NEAR(sum_z("on_bottom"), -2 * 9.81, 0.02) << enum_name(reduce);
    EXPECT_NEAR(sum_z("all"), -9.81, 0.02) << enum_name(reduce);
    const auto n = scene->sensor("on_top").field("normal").data.row<float>(0);
    EXPECT_NEAR(n[2], 1, 1e-6) << enum_name(reduce);
  }
}

// The terrain's names have no prefix "terrain/".
TEST(Contact, TerrainIsAnEntity) {
  scene::SceneCfg cfg;
  cfg.terrain = scene::TerrainCfg{};
  scene::EntityCfg box;
  box.model.xml =
      "<mujoco><worldbody><body name='b' pos='0 0 .1'><freejoint/>"
      "<geom name='g' type='box' size='.1 .1 .1' mass='1'/></body></worldbody></mujoco>";
  cfg.entities.emplace_back("box", box);
  for (const ContactMode mode : {ContactMode::kGeom, ContactMode::kBody}) {
    auto c = std::make_shared<ContactSensorCfg>();
    c->name = enum_name(mode);
    c->primary = {mode, {".*"}, "terrain", {}};
    c->secondary = ContactMatch{"geom", {"g"}, "box", {}};
    c->fields = {"force"};
    c->reduce = ContactReduce::kNetForce;
    c->global_frame = true;
    cfg.sensors.push_back(c);
  }
  auto scene = std::make_shared<scene::Scene>(std::move(cfg));
  sim::Simulation sim(scene, {});
  sim.step(1000);
  for (const char* mode : {"geom", "body"}) {
    sim.refresh(scene->sensor(mode));
    EXPECT_NEAR(std::abs(scene->sensor(mode).field("force").data.row<float>(0)[2]), 9.81, 0.01)
        << mode;
  }
}

// Two feet of one trunk press against each other along x, L from the left. The contact matches the
// trunk and R and, in the other direction, the trunk and L.
//
//          trunk
//        L --><-- R
constexpr char kFeet[] = R"(
<mujoco><option gravity="0 0 0"/><worldbody><body name="trunk" pos="0 0 1"><freejoint/>
  <geom size=".1" pos="0 0 .5"/>
  <body name="L" pos="-.099 0 0"><joint type="slide" axis="1 0 0"/><geom name="L" size=".1" mass="1"/></body>
  <body name="R" pos=".099 0 0"><joint type="slide" axis="1 0 0"/><geom name="R" size=".1" mass="1"/></body>
</body></worldbody></mujoco>)";

ContactSensorCfg feet_cfg(std::string name, NamedEnum<ContactMode> mode,
                          std::vector<std::string> pattern) {
  ContactSensorCfg c;
  c.name = std::move(name);
  c.primary = {"subtree", {"trunk"}, "bot", {}};
  c.secondary = ContactMatch{mode, std::move(pattern), "bot", {}};
  c.secondary_policy = "each";
  return c;
}

TEST(Contact, ContactInBothDirectionsIsInBothPairs) {
  ContactSensorCfg net = feet_cfg("net", "subtree", {"trunk", "L", "R"});
  net.reduce = "netforce";
  ContactLab lab(
      "bot", kFeet,
      {feet_cfg("bodies", "body", {"L", "R"}), feet_cfg("subtrees", "subtree", {"L", "R"}),
       feet_cfg("geoms", "geom", {"R", "L"}), net});
  lab.sim->forward();
  for (const char* name : {"bodies", "subtrees", "geoms"}) {
    EXPECT_THAT(lab.read("found", name), ElementsAre(1))
        << name;  // one contact, also if it is in two pairs
    EXPECT_THAT(lab.read("pair_found", name), ElementsAre(1, 1)) << name;
    const std::vector<float> force = lab.read("pair_force", name);
    EXPECT_GT(force[3], 1) << name;  // force on R, to the right
    EXPECT_EQ(force[0], -force[3]) << name;
    for (int i : {1, 2, 4, 5}) EXPECT_NEAR(force[i], 0, 1e-6) << name;
  }
  // The contact of the trunk with itself counts once, as geom 1.
  EXPECT_THAT(lab.read("pair_found", "net"), ElementsAre(1, 1, 1));
  const std::vector<float> force = lab.read("pair_force", "net");
  EXPECT_EQ(force[0], force[6]);
  EXPECT_EQ(force[0], lab.read("force", "net")[0]);
}

TEST(Contact, WithoutAnEntityPatternsAreFullNamesOrRegularExpressions) {
  const auto cfg = [](std::string name, std::vector<std::string> pattern,
                      std::vector<std::string> exclude) {
    ContactSensorCfg c;
    c.name = std::move(name);
    c.primary = {"geom", std::move(pattern), "", std::move(exclude)};
    return c;
  };
  ContactLab lab("bot", kFeet,
                 {cfg("names", {"bot/R", "bot/L"}, {}), cfg("regex", {"bot/[LR]"}, {}),
                  cfg("exclude", {"bot/.*"}, {"bot/L", "geom_."})});
  EXPECT_THAT(lab.sensor("names").primary_names(), ElementsAre("bot/R", "bot/L"));
  EXPECT_THAT(lab.sensor("regex").primary_names(), ElementsAre("bot/L", "bot/R"));
  EXPECT_THAT(lab.sensor("exclude").primary_names(), ElementsAre("bot/R"));
  EXPECT_THROW(ContactLab("bot", kFeet, {cfg("none", {"foot.*"}, {})}), ValueError);
  EXPECT_THROW(ContactLab("bot", kFeet, {cfg("twice", {"bot/L", "bot/[LR]"}, {})}), ValueError);
}

TEST(Contact, ExcludeRemovesSecondaries) {
  ContactSensorCfg each = feet_cfg("each", "geom", {".*"}),
                   first = feet_cfg("first", "geom", {".*"});
  ContactSensorCfg literal = feet_cfg("literal", "subtree", {"L"});
  each.secondary->exclude = {"L", "geom_"};
  first.secondary->exclude = {"geom_0", "^L$"};
  literal.secondary->exclude = {"R"};
  first.secondary_policy = literal.secondary_policy = "first";
  ContactLab lab("bot", kFeet, {each, first, literal});
  lab.sim->forward();
  // "geom_" has no special character: it excludes an exact name.
  EXPECT_THAT(lab.sensor("each").secondary_names(), ElementsAre("geom_0", "R"));
  EXPECT_THAT(lab.sensor("first").secondary_names(), ElementsAre("R"));
  EXPECT_THAT(lab.sensor("literal").secondary_names(), ElementsAre("L"));
  EXPECT_THAT(lab.read("found", "first"), ElementsAre(1));

  for (ContactPolicy policy :
       {ContactPolicy::kEach, ContactPolicy::kFirst, ContactPolicy::kError}) {
    ContactSensorCfg c = feet_cfg("none", "subtree", {"L"});
    c.secondary_policy = policy;
    c.secondary->exclude = {"L"};
    EXPECT_THAT([&] { ContactLab("bot", kFeet, {c}); },
                ::testing::ThrowsMessage<ValueError>(
                    HasSubstr("sensor 'none': secondary: exclude removes every match: L")))
        << enum_name(policy);
  }
}

// Existence and position of contacts are known without the solver. A sensor that needs only these
// must not run it, and must leave a state from which forces can be read afterwards.
TEST(Contact, WithoutForcesNeedsPositionsOnly) {
  const auto needs = [](auto&& change) {
    ContactSensorCfg cfg = box_cfg();
    cfg.fields = {"found"};
    change(cfg);
    return ContactSensor(cfg).needs();
  };
  using Cfg = ContactSensorCfg;
  EXPECT_EQ(needs([](Cfg&) {}), mjSTAGE_POS);
  EXPECT_EQ(needs([](Cfg& c) { c.track_air_time = c.track_events = true; }), mjSTAGE_POS);
  EXPECT_EQ(needs([](Cfg& c) {
              c.fields = {"found", "dist", "normal"}, c.reduce = "mindist";
            }),
            mjSTAGE_POS);
  // dist is that of the strongest contact.
  EXPECT_EQ(needs([](Cfg& c) { c.fields = {"found", "dist"}; }), mjSTAGE_ACC);
  EXPECT_EQ(needs([](Cfg& c) { c.fields = {"torque"}, c.reduce = "none"; }), mjSTAGE_ACC);
  EXPECT_EQ(needs([](Cfg& c) { c.reduce = "netforce"; }), mjSTAGE_ACC);
  EXPECT_EQ(needs([](Cfg& c) { c.latch = true; }), mjSTAGE_ACC);
  EXPECT_EQ(needs([](Cfg& c) { c.friction_split = true; }), mjSTAGE_ACC);
  EXPECT_EQ(needs([](Cfg& c) { c.other_ids = true; }), mjSTAGE_ACC);

  ContactSensorCfg found = box_cfg(), net = box_cfg();
  found.name = "found";
  found.fields = {"found"};
  net.fields = {"found", "force", "pos"};
  net.reduce = "netforce";
  ContactLab late("box", kBox, {found, net}), first("box", kBox, {found, net});
  for (ContactLab* lab : {&late, &first}) {
    lab->pose({0, 0, 0.12, 0.97, 0.2, 0.14, 0});
    lab->sim->forward();
  }
  bool touched = false;
  for (int i = 0; i < 100; ++i) {
    late.sim->step();
    first.sim->step();
    const std::vector<float> force = first.read("force");
    ASSERT_EQ(late.read("found", "found"), first.read("found"));
    if (i % 3) continue;  // the other steps end without a solve
    ASSERT_EQ(late.read("force"), force) << i;
    ASSERT_EQ(late.read("pos"), first.read("pos")) << i;
    touched |= force[2] < 0;
  }
  EXPECT_TRUE(touched);
}

TEST(Contact, PartsAreMuJoCosPerFieldSensors) {
  ContactLab lab("box", kBox, {box_cfg()});
  EXPECT_TRUE(lab.scene->find_sensor("c_box_geom_found"));
  lab.pose({0, 0, 0.0995, 1, 0, 0, 0});
  lab.sim->forward();
  EXPECT_THAT(lab.read("", "c_box_geom_found"), ElementsAre(4.0f));
}

// Errors that do not depend on the model are found by build().
TEST(Contact, InvalidConfigurationsAreRefusedAtBuild) {
  const auto message = [](auto change) -> std::string {
    ContactSensorCfg cfg = box_cfg();
    change(cfg);
    return error_of([&] { cfg.build(); });
  };
  using Cfg = ContactSensorCfg;
  const std::string context = "sensor '" + box_cfg().name + "': ";
  EXPECT_EQ(message([](Cfg&) {}), "");
  EXPECT_EQ(message([](Cfg& c) { c.fields = {"fond"}; }),
            context +
                "fields is 'fond': must be one of found, force, torque, dist, pos, normal, "
                "tangent; did you mean 'found'?");
  EXPECT_THAT(message([](Cfg& c) { c.primary.pattern = {"("}; }), HasSubstr("primary"));
  EXPECT_THAT(message([](Cfg& c) { c.primary.pattern.clear(); }), HasSubstr("no pattern"));
  EXPECT_THAT(message([](Cfg& c) {
                c.secondary = ContactMatch{"geom", {"a", "b"}, "", {}};
              }),
              HasSubstr("secondary: 2 patterns"));
  EXPECT_THAT(message([](Cfg& c) { c.viz.point_color[0] = 2; }),
              HasSubstr("viz: point_color[0] is 2: must be between 0 and 1"));
  EXPECT_THAT(message([](Cfg& c) { c.name = ""; }), HasSubstr("needs a name"));
}

TEST(Contact, ErrorsNameSensorAndNearest) {
  const auto message = [](ContactSensorCfg cfg) -> std::string {
    return error_of([&] { ContactLab lab("box", kBox, {std::move(cfg)}); });
  };
  EXPECT_THAT(message(box_cfg("BOX_GEOM")), HasSubstr("Not all regular expressions are matched"));
  ContactSensorCfg c = box_cfg();
  c.primary.exclude = {"box_.*"};
  EXPECT_THAT(message(c), HasSubstr("exclude removes every match"));
  c = box_cfg();
  c.primary.entity = "bax";
  EXPECT_THAT(message(c), HasSubstr("entity 'bax' not found; did you mean 'box'?"));
  c = box_cfg();
  c.num_slots = 0;
  EXPECT_THAT(message(c), HasSubstr("sensor 'c': num_slots is 0: must be at least 1"));
  c = box_cfg();
  c.fields = {"found", "froce"};
  EXPECT_THAT(message(c), HasSubstr("did you mean 'force'?"));
  c = box_cfg();
  c.secondary = ContactMatch{"geom", {"ground_geom", "box_geom"}, "box", {}};
  EXPECT_THAT(message(c), HasSubstr("single name"));
}

// Three balls of 1, 3 and 1 kg lie on a tray.
TEST(Contact, NetforceNamesTheStrongestContact) {
  constexpr char kTray[] = R"(
<mujoco><worldbody>
  <body name="tray"><geom name="tray" type="box" size=".5 .1 .05"/></body>
  <body pos="-.3 0 .0999"><joint type="slide" axis="0 0 1"/><geom name="left" size=".05" mass="1"/></body>
  <body pos="0 0 .0999"><freejoint/><geom name="heavy" size=".05" mass="3"/></body>
  <body pos=".3 0 .0999"><joint type="slide" axis="0 0 1"/><geom name="right" size=".05" mass="1"/></body>
</worldbody></mujoco>)";
  ContactSensorCfg net = box_cfg("tray");
  net.reduce = "netforce";
  net.fields = {"found"};
  net.other_ids = true;
  ContactLab lab("box", kTray, {net});
  lab.sim->step(500);
  EXPECT_EQ(lab.read("found")[0], 3.0f);
  const mjModel* m = lab.scene->model();
  EXPECT_EQ(lab.sensor().field("other_geom").data.row<std::int32_t>(0)[0],
            mj_name2id(m, mjOBJ_GEOM, "box/heavy"));
}

}  // namespace
}  // namespace mjsense::sensors
