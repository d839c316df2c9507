// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sim/simulation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "mjsense/core/control_step.h"
#include "mjsense/core/error.h"
#include "mjsense/core/row_error.h"
#include "mjsense/core/testing/allocations.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"

namespace mjsense::sim {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kXml[] = R"(
<mujoco>
  <worldbody>
    <body name="ball" pos="0 0 1"><freejoint/><geom name="ball" type="sphere" size=".1"/></body>
  </worldbody>
</mujoco>)";

std::shared_ptr<scene::Scene> scene() {
  scene::SceneCfg cfg;
  cfg.entities.emplace_back("robot", scene::EntityCfg{.model = {.xml = kXml}});
  cfg.terrain = scene::TerrainCfg{};
  return std::make_shared<scene::Scene>(cfg);
}

// Height of the ball. Counts the calls of its functions.
struct Height : Sensor {
  explicit Height(std::string name, Stage stage = Stage::kRow)
      : Sensor(std::move(name)), stage_(stage) {}
  std::string_view kind() const override { return "height"; }
  void initialize(const SensorInit& init) override {
    add_field("", {.shape = {1}, .unit = "m"}, init.num_worlds);
    computes.assign(init.num_worlds, 0);
    substeps.assign(init.num_worlds, 0);
    resets.assign(init.num_worlds, 0);
  }
  void compute(const World& w) override {
    if (w.id == fail_in && failure == ErrorKind::kKey) throw KeyError("no name");
    if (w.id == fail_in && failure == ErrorKind::kRuntime) throw RuntimeError("no luck");
    if (w.id == fail_in) throw ValueError("no value");
    ++computes[w.id];
    solves = w.data->timer[mjTIMER_CONSTRAINT].number;
    positions = w.data->timer[mjTIMER_POSITION].number;
    row(w.id) = static_cast<float>(w.data->xpos[3 * (w.model->nbody - 1) + 2]);
  }
  void substep(const World& w) override {
    ++substeps[w.id];
    solves = w.data->timer[mjTIMER_CONSTRAINT].number;
    last_dt = w.dt();
  }
  void reset(const World& w) override { ++resets[w.id]; }
  void cast(const CastContext& context) override {
    ++casts;
    cast_ids.assign(context.ids.begin(), context.ids.end());
    if (on_cast) on_cast();
  }
  bool wants_substep() const override { return with_substeps; }
  bool needs_every_step() const override { return is_eager; }
  mjtStage needs() const override { return reads_up_to; }
  Stage stage() const override { return stage_; }
  std::span<Sensor* const> inputs() const override { return input_list; }
  float& row(int w) { return fields()[0].data.row<float>(w)[0]; }

  Stage stage_;
  bool with_substeps = false, is_eager = false;
  ErrorKind failure = ErrorKind::kValue;
  double last_dt = 0;
  mjtStage reads_up_to = mjSTAGE_ACC;
  int fail_in = -1, casts = 0, solves = 0, positions = 0;  // numbers of calls, counted by MuJoCo
  std::vector<int> computes, substeps, resets, cast_ids;
  std::vector<Sensor*> input_list;
  std::function<void()> on_cast;
};

template <class... Args>
std::shared_ptr<Height> add(Simulation& sim, Args... args) {
  auto sensor = std::make_shared<Height>(args...);
  sim.add(sensor);
  return sensor;
}

TEST(Simulation, ComputesOnceUntilTheStateChanges) {
  Simulation sim(scene(), {.num_worlds = 3, .decimation = 2, .threads = 2});
  auto h = add(sim, "h");
  EXPECT_THAT(h->computes, Each(0));
  sim.refresh(*h);
  sim.refresh(*h);
  EXPECT_THAT(h->computes, Each(1));
  EXPECT_FLOAT_EQ(h->row(1), 1.0f);
  sim.step();  // was read: computed in the same pass
  EXPECT_THAT(h->computes, Each(2));
  sim.refresh(*h);
  EXPECT_THAT(h->computes, Each(2));
  EXPECT_LT(h->row(1), 1.0f);
  sim.step(3);  // was read once since, so only the last step computes it
  EXPECT_THAT(h->computes, Each(3));
  sim.step();  // was not read since: computed on demand again
  EXPECT_THAT(h->computes, Each(3));
}

TEST(Simulation, ReadsTheCurrentState) {
  Simulation sim(scene(), {.decimation = 5});
  auto h = add(sim, "h");
  sim.step(4);
  sim.refresh(*h);
  const auto* qpos = reinterpret_cast<const double*>(sim.worlds().state_component("qpos").data);
  EXPECT_FLOAT_EQ(h->row(0), static_cast<float>(qpos[2]));
}

// Beyond the integration, a step computes only the stages needed by the sensors that are read.
TEST(Simulation, ComputesTheStagesThatItsSensorsNeed) {
  Simulation sim(scene(), {.decimation = 2});
  const auto sensor = [&](mjtStage stage) {
    auto s = std::make_shared<Height>("h" + std::to_string(stage));
    s->reads_up_to = stage;
    sim.add(s);
    return s;
  };
  auto none = sensor(mjSTAGE_NONE), place = sensor(mjSTAGE_POS), force = sensor(mjSTAGE_ACC);
  auto* push = reinterpret_cast<double*>(sim.worlds().state_component("qfrc_applied").data);
  const auto step = [&](Height& read) {
    push[0] += 0.1;  // invalidates the previous constraint solve
    sim.step();
    sim.refresh(read);
  };
  const auto count = [&](Height& read) {
    step(read);
    const int positions = read.positions, solves = read.solves;
    for (int k = 0; k < 10; ++k) step(read);
    return std::pair(read.positions - positions, read.solves - solves);
  };
  EXPECT_EQ(count(*none), std::pair(20, 20));
  EXPECT_EQ(count(*place), std::pair(20, 20));
  EXPECT_EQ(count(*force), std::pair(20, 30));
  const auto* qpos = reinterpret_cast<const double*>(sim.worlds().state_component("qpos").data);
  sim.step();
  sim.refresh(*place);
  EXPECT_FLOAT_EQ(place->row(0), static_cast<float>(qpos[2]));
}

// A sensor with substep() gets the forces there if it needs mjSTAGE_ACC.
TEST(Simulation, SubstepsHaveTheStagesThatTheirSensorsNeed) {
  for (const mjtStage stage : {mjSTAGE_POS, mjSTAGE_ACC}) {
    Simulation sim(scene(), {.decimation = 2});
    auto s = std::make_shared<Height>("h");
    s->with_substeps = true;
    s->reads_up_to = stage;
    sim.add(s);
    sim.step();
    const int before = s->solves;
    reinterpret_cast<double*>(sim.worlds().state_component("qfrc_applied").data)[0] = 0.1;
    sim.step();  // the first substep solves anew, the second reuses the solve done for the sensor
    EXPECT_EQ(s->solves - before, stage == mjSTAGE_ACC ? 3 : 2);
  }
}

TEST(Simulation, PartialResetRefreshesExactlyThoseWorlds) {
  Simulation sim(scene(), {.num_worlds = 4});
  auto h = add(sim, "h");
  sim.step(50);
  sim.refresh(*h);
  const float before = h->row(1);
  const int ids[] = {2, 0};
  sim.reset(ids);
  EXPECT_THAT(h->resets, ElementsAre(1, 0, 1, 0));
  sim.refresh(*h);
  EXPECT_THAT(h->computes, ElementsAre(2, 1, 2, 1));
  EXPECT_FLOAT_EQ(h->row(2), 1.0f);
  EXPECT_EQ(h->row(1), before);
}

// An episode starts with a reset, writes of the state, and a forward. Sensors must not be computed
// before that.
TEST(Simulation, ResetAndForwardComputeWhenReadNotBefore) {
  Simulation sim(scene(), {.num_worlds = 2});
  auto h = add(sim, "h");
  sim.refresh(*h);
  sim.reset();
  sim.forward();
  EXPECT_THAT(h->computes, Each(1));
  sim.refresh(*h);
  EXPECT_THAT(h->computes, Each(2));
}

TEST(Simulation, StepsSomeWorldsAlone) {
  Simulation sim(scene(), {.num_worlds = 3});
  auto h = add(sim, "h");
  sim.measure_cost(true);
  sim.refresh(*h);
  const int ids[] = {0, 2};
  sim.step(20, ids);
  sim.refresh(*h);
  EXPECT_THAT(h->computes, ElementsAre(2, 1, 2));
  EXPECT_LT(h->row(0), 1.0f);
  EXPECT_FLOAT_EQ(h->row(1), 1.0f);
  EXPECT_EQ(h->row(0), h->row(2));
  EXPECT_EQ(sim.worlds().substeps(1), 0);
  EXPECT_GT(sim.cost(*h).compute, 0.0);
}

TEST(Simulation, EagerSensorsAndTheirInputsRunEveryControlStep) {
  Simulation sim(scene(), {.num_worlds = 2, .decimation = 3});
  auto in = add(sim, "in");
  auto filter = std::make_shared<Height>("filter");
  filter->is_eager = filter->with_substeps = true;
  filter->input_list = {in.get()};
  sim.add(filter);
  sim.step(5);
  EXPECT_THAT(filter->computes, Each(5));
  EXPECT_THAT(in->computes, Each(5));
  EXPECT_THAT(filter->substeps, Each(15));
  const int ids[] = {1};
  sim.forward(ids);
  EXPECT_THAT(filter->computes, ElementsAre(5, 6));
  EXPECT_THAT(in->computes, ElementsAre(5, 6));
}

// A sensor that counts control steps and cannot compute the rows of some worlds.
struct Stepped final : Sensor, ControlStepListener {
  explicit Stepped(std::string name) : Sensor(std::move(name)) {}
  std::string_view kind() const override { return "stepped"; }
  Stage stage() const override { return Stage::kBatch; }
  void initialize(const SensorInit& init) override {
    add_field("", {.shape = {1}}, init.num_worlds);
    steps.assign(init.num_worlds, 0);
    casts.assign(init.num_worlds, 0);
  }
  void compute(const World& /*world*/) override {}
  void control_step(std::span<const int> ids) override {
    for (int w : ids) ++steps[w];
    if (!fail_step.empty()) throw RowError(fail_step);
  }
  void cast(const CastContext& context) override {
    std::vector<RowError::Fault> faults;
    for (int w : context.ids) {
      ++casts[w];
      steps_at_cast = steps;
      for (const RowError::Fault& fault : fail) {
        if (fault.world == w) faults.push_back(fault);
      }
    }
    if (!faults.empty()) throw RowError(faults);
  }
  std::vector<int> steps, casts, steps_at_cast;
  std::vector<RowError::Fault> fail, fail_step;
};

TEST(Simulation, NotifiesListenersOfEveryControlStep) {
  Simulation sim(scene(), {.num_worlds = 3, .decimation = 2});
  auto sensor = std::make_shared<Stepped>("s");
  sim.add(sensor);
  sim.step(2);  // also a sensor that is not read
  EXPECT_THAT(sensor->steps, Each(2));
  EXPECT_THAT(sensor->casts, Each(0));
  sim.refresh(*sensor);
  const int ids[] = {0, 2};
  sim.step(1, ids);
  EXPECT_THAT(sensor->steps, ElementsAre(3, 2, 3));
  EXPECT_EQ(sensor->steps_at_cast, sensor->steps);
  sim.reset();
  sim.forward();
  sim.invalidate();
  sim.refresh(*sensor);
  EXPECT_THAT(sensor->steps, ElementsAre(3, 2, 3));
}

TEST(Simulation, OnlyFailedRowsAreRecomputed) {
  Simulation sim(scene(), {.num_worlds = 4});
  auto first = std::make_shared<Stepped>("first"), second = std::make_shared<Stepped>("second");
  sim.add(first);
  sim.add(second);
  sim.refresh(*first);
  sim.refresh(*second);
  first->fail = {{1, "sensor 'first', world 1: no"}, {3, "sensor 'first', world 3: no"}};
  first->fail_step = {{2, "sensor 'first', world 2: no"}};
  EXPECT_EQ(error_of<RowError>([&] { sim.step(); }), "sensor 'first', world 2: no");
  EXPECT_THAT(first->steps, Each(1));
  EXPECT_THAT(second->steps, Each(1));  // is notified nevertheless
  try {
    sim.refresh(*first);
    FAIL();
  } catch (const RowError& e) {
    ASSERT_EQ(e.faults.size(), 2u);
    EXPECT_EQ(e.faults[1].world, 3);
  }
  EXPECT_THAT(first->casts, Each(2));
  EXPECT_THROW(sim.refresh(*first), RowError);
  EXPECT_THAT(first->casts, ElementsAre(2, 3, 2, 3));
  const int ids[] = {0, 2};
  Sensor* both[] = {first.get(), second.get()};
  sim.refresh(both, ids);
  EXPECT_THAT(first->casts, ElementsAre(2, 3, 2, 3));
  EXPECT_THAT(second->casts, ElementsAre(2, 1, 2, 1));
}

TEST(Simulation, RayCastsFollowComputationAndFiltersFollowRayCasts) {
  Simulation sim(scene(), {.num_worlds = 3});
  auto camera = add(sim, "camera", Stage::kCast);
  auto points = std::make_shared<Height>("points", Stage::kPostCast);
  points->input_list = {camera.get()};
  sim.add(points);
  std::vector<int> seen;
  camera->on_cast = [&] { seen = points->computes; };
  sim.refresh(*points);
  EXPECT_THAT(seen, Each(0));
  EXPECT_THAT(points->computes, Each(1));
  EXPECT_EQ(camera->casts, 1);
  const int ids[] = {1};
  sim.reset(ids);
  sim.refresh(*points);
  EXPECT_THAT(camera->cast_ids, ElementsAre(1));
}

// Whatever its own stage, a sensor is computed after the casts of its inputs, and casts after those.
TEST(Simulation, SensorIsComputedAfterTheRayCastsThatItReads) {
  Simulation sim(scene(), {.num_worlds = 3});
  auto camera = add(sim, "camera", Stage::kCast);
  auto reader = std::make_shared<Height>("reader", Stage::kRow);
  reader->input_list = {camera.get()};
  sim.add(reader);
  auto second = std::make_shared<Height>("second", Stage::kCast);
  second->input_list = {reader.get()};
  sim.add(second);
  std::vector<int> at_first_cast, at_second_cast;
  camera->on_cast = [&] { at_first_cast = reader->computes; };
  second->on_cast = [&] { at_second_cast = reader->computes; };
  sim.refresh(*second);
  EXPECT_THAT(at_first_cast, Each(0));
  EXPECT_THAT(at_second_cast, Each(1));
}

// A sensor written in Python may read other sensors while it is computed.
TEST(Simulation, BatchSensorsCanReadOtherSensors) {
  Simulation sim(scene(), {.num_worlds = 2});
  auto h = add(sim, "h");
  auto user = add(sim, "user", Stage::kBatch);
  user->on_cast = [&] { sim.refresh(*h); };
  sim.refresh(*user);
  sim.step();
  EXPECT_EQ(user->casts, 2);
  EXPECT_THAT(h->computes, Each(2));
}

TEST(Simulation, FailingSensorIsNamedAndOthersContinue) {
  Simulation sim(scene(), {.num_worlds = 3});
  auto bad = add(sim, "bad");
  auto good = add(sim, "good");
  bad->fail_in = 1;
  EXPECT_EQ(error_of<ValueError>([&] { sim.refresh(*bad); }), "sensor 'bad': no value");
  sim.step();
  sim.refresh(*good);
  bad->fail_in = -1;
  sim.refresh(*bad);
  EXPECT_THAT(good->computes, Each(1));
}

// Throws this exception in one world and one of its functions.
struct Throwing : Sensor {
  explicit Throwing(Stage stage) : Sensor("throwing"), stage_(stage) {}
  std::string_view kind() const override { return "throwing"; }
  void initialize(const SensorInit& init) override {
    add_field("", {.shape = {1}, .unit = "m"}, init.num_worlds);
  }
  void call(const char* function, int world) const {
    if (std::string_view(function) != in || world != 1) return;
    if (memory) throw std::bad_alloc();
    throw 42;  // not derived from std::exception
  }
  void compute(const World& w) override { call("compute", w.id); }
  void substep(const World& w) override { call("substep", w.id); }
  void reset(const World& w) override { call("reset", w.id); }
  void cast(const CastContext& context) override {
    for (int w : context.ids) call("cast", w);
  }
  bool wants_substep() const override { return true; }
  bool needs_every_step() const override { return true; }
  Stage stage() const override { return stage_; }

  Stage stage_;
  std::string_view in;
  bool memory = true;
};

// Whatever a sensor throws on MuJoCo's threads reaches the caller. The other worlds are stepped, and
// after a reset of its own world the simulation equals one in which nothing was thrown.
TEST(Simulation, AnyExceptionOfASensorReachesTheCaller) {
  for (const char* in : {"compute", "substep", "reset", "cast"}) {
    for (const bool memory : {true, false}) {
      SCOPED_TRACE(::testing::Message() << in << (memory ? " bad_alloc" : " int"));
      const SimulationCfg cfg{.num_worlds = 3, .decimation = 2, .threads = 2};
      Simulation sim(scene(), cfg), plain(scene(), cfg);
      auto bad =
          std::make_shared<Throwing>(std::string_view(in) == "cast" ? Stage::kCast : Stage::kRow);
      sim.add(bad);
      auto good = add(sim, "good");
      sim.step(2);
      plain.step(2);
      bad->in = in;
      bad->memory = memory;
      for (int k = 0; k < 3; ++k) {
        try {
          std::string_view(in) == "reset" ? sim.reset() : sim.step();
          FAIL() << "nothing was thrown";
        } catch (const std::bad_alloc& e) {
          EXPECT_TRUE(memory);
          EXPECT_STREQ(e.what(), "sensor 'throwing': out of memory");
        } catch (int thrown) {
          EXPECT_FALSE(memory);
          EXPECT_EQ(thrown, 42);
        }
        std::string_view(in) == "reset" ? plain.reset() : plain.step();
      }
      bad->in = "";
      const std::vector<int> world{1};
      sim.reset(world);
      plain.reset(world);
      sim.step();
      plain.step();
      sim.refresh(*good);
      const ArrayView a = sim.worlds().state(), b = plain.worlds().state();
      EXPECT_EQ(std::memcmp(a.data, b.data, 3 * a.strides[0]), 0);
      EXPECT_THAT(good->computes, Each(::testing::Ge(1)));
    }
  }
}

// The sensor's name is added to an error, whose type is unchanged.
TEST(Simulation, ErrorKeepsItsType) {
  Simulation sim(scene(), {.num_worlds = 2});
  auto bad = add(sim, "bad");
  bad->fail_in = 0;
  bad->failure = ErrorKind::kKey;
  EXPECT_THROW(sim.refresh(*bad), KeyError);
  bad->failure = ErrorKind::kRuntime;
  EXPECT_THROW(sim.refresh(*bad), RuntimeError);
  bad->failure = ErrorKind::kValue;
  EXPECT_THROW(sim.refresh(*bad), ValueError);
}

// The name is also added if it occurs by chance in the message: the "a" of "no value".
TEST(Simulation, ErrorNamesItsSensor) {
  Simulation sim(scene(), {.num_worlds = 2});
  auto bad = add(sim, "a");
  bad->fail_in = 0;
  EXPECT_EQ(error_of<ValueError>([&] { sim.refresh(*bad); }), "sensor 'a': no value");
}

TEST(Simulation, StepLastsAsLongAsItsSubsteps) {
  Simulation sim(scene(), {.decimation = 5});
  EXPECT_DOUBLE_EQ(sim.step_dt(), 5 * sim.model()->opt.timestep);
  sim.step(3);
  EXPECT_DOUBLE_EQ(sim.worlds().time(0), 3 * sim.step_dt());
}

// mjlab's order of calls: an update represents the duration that is passed to it.
TEST(Simulation, ManualUpdateUsesTheGivenDuration) {
  Simulation sim(scene(), {});
  auto filter = std::make_shared<Height>("filter");
  filter->with_substeps = true;
  sim.add(filter);
  sim.step_raw(1);
  sim.update_sensors(0.02);
  EXPECT_DOUBLE_EQ(filter->last_dt, 0.02);
  sim.update_sensors();
  EXPECT_DOUBLE_EQ(filter->last_dt, sim.model()->opt.timestep);
  EXPECT_THAT(filter->substeps, Each(2));
}

// A caller that steps its own data and writes the states sees what a step would have shown.
TEST(Simulation, FollowsStatesThatWereWritten) {
  Simulation stepped(scene(), {.num_worlds = 2}), follower(scene(), {.num_worlds = 2});
  const auto copy_state = [&] {
    const auto size = stepped.worlds().state().shape.size() * sizeof(double);
    std::memcpy(follower.worlds().state().data, stepped.worlds().state().data, size);
  };
  auto a = std::make_shared<Height>("a"), b = std::make_shared<Height>("b");
  a->with_substeps = b->with_substeps = true;
  stepped.add(a);
  follower.add(b);
  copy_state();
  follower.reset(worlds::all_worlds, worlds::Worlds::kWrittenState);
  for (int k = 0; k < 20; ++k) {
    stepped.step();
    copy_state();
    follower.follow(1);
    stepped.refresh(*a);
    follower.refresh(*b);
    ASSERT_EQ(a->row(1), b->row(1));
    ASSERT_EQ(stepped.worlds().time(1), follower.worlds().time(1));
  }
  EXPECT_THAT(b->substeps, Each(20));
  const double timestep = stepped.model()->opt.timestep;
  EXPECT_EQ(b->last_dt, timestep);
  const int one[] = {1};
  follower.follow(3, one);  // the caller made three steps at once, in one world
  EXPECT_THAT(b->substeps, ElementsAre(20, 21));
  EXPECT_EQ(b->last_dt, 3 * timestep);
  EXPECT_DOUBLE_EQ(follower.worlds().time(0), 20 * timestep);
  EXPECT_DOUBLE_EQ(follower.worlds().time(1), 23 * timestep);
  follower.reset(one, worlds::Worlds::kWrittenState);
  EXPECT_EQ(follower.worlds().time(1), 0);
  follower.refresh(*b);
  EXPECT_EQ(a->row(1), b->row(1)) << "the state stays";
  EXPECT_THROW(follower.follow(0), ValueError);
}

// Rays hit the world in its current state, not in the state of the first cast.
TEST(Simulation, RaysUseTheCurrentState) {
  scene::SceneCfg cfg;
  cfg.entities.emplace_back("robot", scene::EntityCfg{.model = {.xml = kXml}});
  cfg.terrain = scene::TerrainCfg{};
  auto scan = std::make_shared<sensors::RayCastSensorCfg>();
  scan->name = "scan";
  scan->frame = {{"body", "world", ""}};
  scan->pattern = sensors::UserPattern{.offsets = {{0, 0, 5}}, .directions = {{0, 0, -1}}};
  cfg.sensors = {scan};
  const auto made = std::make_shared<scene::Scene>(std::move(cfg));
  Simulation sim(made, {.num_worlds = 2});
  Sensor& sensor = made->sensor("scan");
  sim.refresh(sensor);
  EXPECT_FLOAT_EQ(sensor.field("distances").data.row<float>(1)[0], 3.9f);
  const ArrayView qpos = sim.worlds().state_component("qpos");
  reinterpret_cast<double*>(qpos.data + qpos.strides[0])[2] = 2.5;
  sim.forward();
  sim.refresh(sensor);
  EXPECT_FLOAT_EQ(sensor.field("distances").data.row<float>(0)[0], 3.9f);
  EXPECT_FLOAT_EQ(sensor.field("distances").data.row<float>(1)[0], 2.4f);
}

TEST(Simulation, StepAllocatesNothing) {
  Simulation sim(scene(), {.num_worlds = 4, .decimation = 2, .threads = 2});
  auto camera = add(sim, "camera", Stage::kCast);
  auto h = add(sim, "h");
  for (int k = 0; k < 3; ++k) {
    sim.step();
    sim.refresh(*camera);
    sim.refresh(*h);
  }
  const AllocationCount count;
  for (int k = 0; k < 10; ++k) {
    sim.step();
    sim.refresh(*camera);
    sim.refresh(*h);
  }
  EXPECT_EQ(count.since(), 0);
}

// An empty list of worlds ("the worlds that are done") must not mean all worlds.
TEST(Simulation, EmptyListOfWorldsMeansNone) {
  Simulation sim(scene(), {.num_worlds = 3});
  auto h = add(sim, "h");
  sim.step(5);
  sim.refresh(*h);
  const std::vector<int> computes = h->computes, none;
  sim.reset(none);
  sim.forward(none);
  sim.reset_sensors(none);
  sim.invalidate(none);
  sim.step(4, none);
  EXPECT_THAT(h->resets, ElementsAre(0, 0, 0));
  EXPECT_EQ(sim.worlds().substeps(0), 5);
  sim.refresh(*h);
  EXPECT_EQ(h->computes, computes) << "nothing became stale";
  Sensor* one[] = {h.get()};
  sim.invalidate();
  sim.refresh(one, none);
  EXPECT_EQ(h->computes, computes);
  sim.reset(worlds::all_worlds);
  EXPECT_THAT(h->resets, ElementsAre(1, 1, 1));
}

TEST(Simulation, UnknownWorldsThrow) {
  Simulation sim(scene(), {.num_worlds = 3});
  auto h = add(sim, "h");
  Sensor* one[] = {h.get()};
  for (const std::vector<int>& bad : {std::vector<int>{3}, {-1}, {1, 1}}) {
    EXPECT_THROW(sim.step(1, bad), ValueError);
    EXPECT_THROW(sim.reset(bad), ValueError);
    EXPECT_THROW(sim.forward(bad), ValueError);
    EXPECT_THROW(sim.refresh(one, bad), ValueError);
    EXPECT_THROW(sim.invalidate(bad), ValueError);
    EXPECT_THROW(sim.reset_sensors(bad), ValueError);
  }
}

TEST(Simulation, SceneIsUsedByOneSimulationAtATime) {
  const auto shared = scene();
  {
    Simulation first(shared, {.num_worlds = 4});
    EXPECT_THAT(error_of<RuntimeError>([&] { Simulation second(shared, {}); }),
                HasSubstr("belongs to a simulation already"));
    first.step();
  }
  EXPECT_THROW(Simulation(shared, {.num_worlds = 0}), ValueError);
  Simulation after(shared, {.num_worlds = 2});
  after.step();
}

TEST(Simulation, ReadsOfForeignSensorsAreErrors) {
  Simulation sim(scene(), {});
  Height foreign("foreign");
  EXPECT_THROW(sim.refresh(foreign), ValueError);
  EXPECT_THROW(sim.step(0), ValueError);
  EXPECT_THROW(Simulation(scene(), {.decimation = 0}), ValueError);
}

}  // namespace
}  // namespace mjsense::sim
