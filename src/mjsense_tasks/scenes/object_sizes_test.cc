// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_sizes.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/temp_dir.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense_tasks/scenes/episode_scene.h"

namespace mjsense::tasks::scenes {
namespace {

using ::testing::HasSubstr;

constexpr char kRoom[] = R"(
<mujoco>
  <worldbody>
    <geom type="plane" size="2 2 .1"/>
    <body name="table" pos="1 0 0"><geom name="top" type="box" size=".5 .4 .01" pos="0 0 .5"/></body>
  </worldbody>
</mujoco>)";

// An object with boxes off the origin, a lying cylinder, a colliding mesh whose inertial frame
// differs from that of its vertices, and a part fixed to it.
std::string thing(double s) {
  const auto v = [&](double x, double y, double z) {
    return fmt::format("{:.17g} {:.17g} {:.17g}", s * x, s * y, s * z);
  };
  std::string scale = fmt::format("{0:.17g} {0:.17g} {0:.17g}", s);
  return "<mujoco><asset><mesh name='wedge' scale='" + scale +
         "' vertex='0 0 0  .03 0 0  0 .02 0  0 0 .04  .03 .02 .01'/></asset>"
         "<worldbody><body name='thing'><freejoint/>"
         "<geom type='box' size='" +
         v(.02, .01, .015) + "' pos='" + v(.01, 0, .015) +
         "'/>"
         "<geom type='box' size='" +
         v(.01, .012, .02) + "' pos='" + v(-.015, .005, .02) +
         "' euler='0 0 30'/>"
         "<geom type='cylinder' size='" +
         v(.01, .02, 0) + "' pos='" + v(.03, 0, .01) +
         "' euler='90 0 0'/>"
         "<geom type='mesh' mesh='wedge' pos='" +
         v(0, .02, .01) +
         "' euler='10 20 30'/>"
         "<site name='tip' pos='" +
         v(.05, 0, 0) + "' size='" + v(.003, .003, .003) +
         "'/>"
         "<body name='part' pos='" +
         v(0, -.03, .02) + "'><geom type='sphere' size='" + v(.012, 0, 0) +
         "' density='3000'/></body>"
         "</body></worldbody></mujoco>";
}

struct Files {
  testing::TempDir dir;
  SceneFileCfg cfg;

  explicit Files(double size = 1) {
    write("room.xml", kRoom);
    write("thing.xml", thing(size));
    write("ball.xml",
          "<mujoco><worldbody><body name='ball'><freejoint/><geom type='sphere' size='.02'/></body>"
          "</worldbody></mujoco>");
    cfg.name = "one_table";
    cfg.entities = {{"room", dir.file("room.xml")},
                    {"a", dir.file("thing.xml"), {0, 0, .2}},
                    {"b", dir.file("ball.xml"), {.3, 0, .2}}};
    cfg.objects = {{"a/thing"}, {"b/ball"}};
    cfg.regions = {{"table", "room/top"}};
  }
  void write(const char* name, const std::string& text) const {
    std::ofstream(dir.path / name) << text;
  }
};

struct Played {
  EpisodeScene scene;
  std::shared_ptr<sim::Simulation> sim;

  explicit Played(SceneFileCfg cfg, int worlds = 1, int threads = 1) : scene(std::move(cfg)) {
    scene::SceneCfg whole = scene.scene_cfg("robot_0");
    std::erase_if(whole.entities, [](const auto& entity) { return entity.first == "robot_0"; });
    sim = std::make_shared<sim::Simulation>(
        std::make_shared<scene::Scene>(whole),
        sim::SimulationCfg{.num_worlds = worlds, .threads = threads});
    scene.bind(*sim);
    scene.initialize(sim->model(), worlds, "robot_0/");
  }
  void start(std::uint64_t episode, int world = 0) {
    Rng rng(3, 0, stream_of("places"), episode);
    if (scene.vary(world, 3, episode)) sim->worlds().model_changed();
    scene.sample(world, 0, 3, episode, rng, robots::state_row(sim->worlds(), world));
    sim->forward();
  }
  std::vector<double> state(int world) const {
    const robots::StateRow row = robots::state_row(sim->worlds(), world);
    return {row.qpos, row.qpos + sim->model()->nq};
  }
  // This world's model, as MuJoCo returns it.
  ModelPtr model(int world) const {
    ModelPtr copy(mj_copyModel(nullptr, sim->model()));
    mjb_getModel(sim->worlds().batch(), world, copy.get());
    return copy;
  }
};

// Compares the bodies, geoms, sites and joints whose names begin with "a/" with those compiled at
// that size.
void expect_same(const mjModel* found, const mjModel* wanted) {
  const auto near = [](const char* what, const double* a, const double* b, int n, double scale) {
    for (int i = 0; i < n; ++i) EXPECT_NEAR(a[i], b[i], 2e-6 * scale) << what << " " << i;
  };
  const auto maximum = [](const double* x, int n) {
    double greatest = 0;
    for (int i = 0; i < n; ++i) greatest = std::max(greatest, std::abs(x[i]));
    return greatest;
  };
#define SAME(field, first, count, width)                                            \
  near(#field, found->field + (width) * (first), wanted->field + (width) * (first), \
       (count) * (width), maximum(wanted->field + (width) * (first), (count) * (width)))
  const int body = mj_name2id(wanted, mjOBJ_BODY, "a/thing");
  const int geom = wanted->body_geomadr[body], geoms = wanted->body_geomnum[body] + 1;
  ASSERT_EQ(geoms, 5);
  SAME(body_mass, body, 2, 1);
  SAME(body_subtreemass, body, 2, 1);
  SAME(body_inertia, body, 2, 3);
  SAME(body_ipos, body, 2, 3);
  SAME(body_iquat, body, 2, 4);
  SAME(body_pos, body + 1, 1, 3);
  SAME(body_invweight0, body, 2, 2);
  SAME(dof_M0, wanted->body_dofadr[body], 6, 1);
  SAME(dof_invweight0, wanted->body_dofadr[body], 6, 1);
  SAME(geom_size, geom, geoms, 3);
  SAME(geom_pos, geom, geoms, 3);
  SAME(geom_quat, geom, geoms, 4);
  SAME(geom_rbound, geom, geoms, 1);
  SAME(geom_aabb, geom, geoms, 6);
  const int site = mj_name2id(wanted, mjOBJ_SITE, "a/tip");
  SAME(site_pos, site, 1, 3);
  SAME(site_size, site, 1, 3);
#undef SAME
}

TEST(ObjectSizes, AreEvenlySpaced) {
  const std::vector<double> steps = ObjectSizes::steps({.8, 1.3});
  ASSERT_EQ(steps.size(), 6u);
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(steps[k], .8 + .1 * k, 1e-12);
  EXPECT_EQ(ObjectSizes::steps({1, 1}).size(), 1u);
}

TEST(ObjectSizes, ObjectEqualsTheCompiledOne) {
  Files files;
  files.cfg.sizes = {.7, 1.3};
  files.cfg.objects[1].sizes = {1, 1};
  Played played(files.cfg);
  std::set<double> seen;
  for (std::uint64_t episode = 0; episode < 24; ++episode) {
    played.start(episode);
    const double size = played.scene.size(0, 0);
    EXPECT_EQ(played.scene.size(0, 1), 1);
    if (!seen.insert(size).second) continue;
    const Files other(size);
    Played compiled(other.cfg);
    const ModelPtr model = played.model(0);
    expect_same(model.get(), compiled.sim->model());
    EXPECT_NEAR(model->body_subtreemass[0], compiled.sim->model()->body_subtreemass[0], 1e-9);
    const episode::ObjectShape &shape = played.scene.shape(0, 0),
                               &wanted = compiled.scene.shape(0, 0);
    EXPECT_NEAR(shape.low, wanted.low, 1e-6);
    EXPECT_NEAR(shape.high, wanted.high, 1e-6);
    EXPECT_NEAR(shape.reach, wanted.reach, 1e-6);
  }
  EXPECT_GE(seen.size(), 5u);
}

TEST(ObjectSizes, ObjectFallsLikeTheCompiledOne) {
  Files files;
  files.cfg.sizes = {.6, 1.6};
  // The object lies on its side, so that its contacts are outside of the boxes of a smaller object.
  files.cfg.objects[0].rests = {"side"};
  Played played(files.cfg);
  for (std::uint64_t episode : {0u, 3u, 5u}) {
    played.sim->reset();
    played.start(episode);
    Files other(played.scene.size(0, 0));
    other.cfg.entities.resize(2);
    other.cfg.objects.resize(1);
    other.cfg.objects[0].rests = {"side"};
    Played compiled(other.cfg);
    const auto lift = [](Played& one, const double* from) {
      const mjModel* m = one.sim->model();
      const int q = m->jnt_qposadr[m->body_jntadr[one.scene.objects()[0].body]];
      double* qpos = robots::state_row(one.sim->worlds(), 0).qpos + q;
      if (from) std::memcpy(qpos, from, 7 * sizeof(double));
      qpos[2] += from ? 0 : .05;
      one.sim->forward();
      return qpos;
    };
    lift(compiled, lift(played, nullptr));
    for (int k = 0; k < 60; ++k) {
      played.sim->step(1);
      compiled.sim->step(1);
    }
    const double *a = lift(played, lift(played, nullptr)), *b = lift(compiled, nullptr);
    for (int i = 0; i < 7; ++i) EXPECT_NEAR(a[i], b[i], 2e-5) << "episode " << episode << ", " << i;
  }
}

TEST(ObjectSizes, StartsDependOnTheEpisodeOnlyWithoutCollisions) {
  Files files;
  files.cfg.sizes = {.6, 1.6};
  Played one(files.cfg, 1, 1), many(files.cfg, 8, 4);
  for (std::uint64_t episode = 0; episode < 16; ++episode) {
    one.sim->reset();
    many.sim->reset();
    const int world = static_cast<int>(episode) % 8;
    one.start(episode);
    many.start(episode, world);
    struct Hooks final : worlds::WorldHooks {
      const EpisodeScene* scene;
      std::string fault;
      void substep(const World& /*world*/) override {}
      void reset(const World& /*world*/) override {}
      void refreshed(const World& world) override { fault += scene->fault(world); }
    } hooks;
    hooks.scene = &one.scene;
    one.sim->worlds().visit(worlds::all_worlds, hooks);
    EXPECT_EQ(hooks.fault, "");
    one.sim->step(40);
    many.sim->step(40);
    EXPECT_EQ(one.state(0), many.state(world));
  }
}

TEST(ObjectSizes, DiscoveredObjectsHaveSizes) {
  Files files;
  files.cfg.objects.clear();
  files.cfg.sizes = {.8, 1.2};
  Played played(files.cfg);
  played.start(0);
  const double size = played.scene.size(0, 0);
  const Files other(size);
  Played compiled(other.cfg);
  expect_same(played.model(0).get(), compiled.sim->model());
}

TEST(ObjectSizes, ObjectsMoveWithFurniture) {
  Files files;
  SceneVaryCfg table;
  table.what = VaryKind::kBody;
  table.pattern = "room/table";
  table.pos = {.3, .3, .1};
  table.angle = 10;
  files.cfg.vary = {table};
  Played played(files.cfg);
  const mjModel* m = played.sim->model();
  const int body = mj_name2id(m, mjOBJ_BODY, "room/table");
  double minimum = 1e9, maximum = -1e9;
  for (std::uint64_t episode = 0; episode < 20; ++episode) {
    played.start(episode);
    const ModelPtr here = played.model(0);
    const double* at = here->body_pos + 3 * body;
    EXPECT_LE(std::abs(at[0] - 1), .3);
    EXPECT_LE(std::abs(at[2]), .1);
    minimum = std::min(minimum, at[2]);
    maximum = std::max(maximum, at[2]);
    EXPECT_NEAR(played.scene.support_height(0), .51 + at[2], 1e-12);
    const double* qpos = robots::state_row(played.sim->worlds(), 0).qpos;
    for (const SceneObject& object : played.scene.objects()) {
      const double* p = qpos + m->jnt_qposadr[m->body_jntadr[object.body]];
      EXPECT_LE(std::abs(p[0] - at[0]), .5);
      EXPECT_LE(std::abs(p[1] - at[1]), .4);
      EXPECT_GT(p[2], .51 + at[2]);
      EXPECT_LT(p[2], .51 + at[2] + .1);
    }
  }
  EXPECT_GT(maximum - minimum, .08);
}

TEST(ObjectSizes, FaultsNameTheSetting) {
  const auto fault = [](auto change) {
    Files files;
    change(files);
    return error_of([&] { Played played(files.cfg); });
  };
  EXPECT_THAT(fault([](Files& f) {
                f.cfg.sizes = {1.2, .8};
              }),
              HasSubstr("scene 'one_table': sizes is 1.2, 0.8: must be minimum, maximum"));
  EXPECT_THAT(fault([](Files& f) {
                f.cfg.objects[1].sizes = {2, 1};
              }),
              HasSubstr("object 'b/ball': sizes is 2, 1"));
  EXPECT_THAT(fault([](Files& f) {
                f.cfg.sizes = {.8, 1.2};
                f.write("ball.xml",
                        "<mujoco><worldbody><body name='ball'><freejoint/><geom size='.02'/>"
                        "<body name='lid'><joint/><geom size='.01'/></body></body></worldbody>"
                        "</mujoco>");
              }),
              HasSubstr("object 'b/ball' has a moving part, 'b/lid'"));
  EXPECT_THAT(fault([](Files& f) {
                SceneVaryCfg ball;
                ball.what = VaryKind::kBody;
                ball.pattern = "b/ball";
                f.cfg.vary = {ball};
              }),
              HasSubstr("vary body: body 'b/ball' is not a fixed body"));
  EXPECT_THAT(fault([](Files& f) {
                SceneVaryCfg table;
                table.what = VaryKind::kBody;
                table.pattern = "room/table";
                table.hue = 10;
                f.cfg.vary = {table};
              }),
              HasSubstr("saturation and tint do not apply to bodies"));
}

}  // namespace
}  // namespace mjsense::tasks::scenes
