// SPDX-License-Identifier: Apache-2.0
// Air time, events, latch and history compared with an exact replay: the outputs at the end of
// every control step are recomputed from the list of all substeps.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "mjsense/core/testing/test_model.h"
#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense::sensors {
namespace {

// Two elastic balls on vertical rails, pushed at random: contacts of one to a few hundred substeps.
constexpr char kBalls[] = R"(
<mujoco><option timestep="0.002"/>
  <default><geom solref="-250000 -60"/></default>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="a" pos="0 0 .3"><joint type="slide" axis="0 0 1" damping="2"/><geom name="a" size=".1" mass=".2"/></body>
    <body name="b" pos="1 0 .1"><joint type="slide" axis="0 0 1" damping="2"/><geom name="b" size=".1" mass=".2"/></body>
  </worldbody>
</mujoco>)";
constexpr int kBallCount = 2;
constexpr double kDt = 0.002;

struct Sample {
  bool touch[kBallCount];
  double force[kBallCount], dist[kBallCount];
};

struct Replayed {
  int decimation;
  std::unique_ptr<ContactSensor> sensor;
};

std::unique_ptr<ContactSensor> make_sensor(const mjModel* m, int decimation) {
  ContactSensorCfg cfg;
  cfg.name = "balls";
  cfg.primary = {"geom", {"a", "b"}, "", {}};
  cfg.fields = {"found", "force", "dist", "pos"};
  cfg.history_length = 7;
  cfg.track_air_time = cfg.track_events = cfg.latch = true;
  std::unique_ptr<Sensor> s = cfg.build();
  SensorInit init;
  init.model = m;
  init.decimation = decimation;
  s->initialize(init);
  return std::unique_ptr<ContactSensor>(static_cast<ContactSensor*>(s.release()));
}

// The phase at the end of samples[0 .. end), and the last completed phase of each kind before it.
struct Phases {
  bool touch = false;
  int current = 0, last_contact = 0, last_air = 0;
};

void advance(Phases& p, bool touch, bool is_first) {
  if (is_first || touch == p.touch) {
    ++p.current;
  } else {
    (p.touch ? p.last_contact : p.last_air) = p.current + 1;  // includes the transition's substep
    p.current = 1;
  }
  p.touch = touch;
}

void check(const Replayed& r, const std::vector<Sample>& samples, const Phases* phases,
           int* touchdowns) {
  const ContactSensor& s = *r.sensor;
  const auto f = [&](const char* name) { return s.field(name).data.row<float>(0); };
  const auto b = [&](const char* name) { return s.field(name).data.row<bool>(0); };
  const std::size_t end = samples.size(), begin = end - r.decimation;
  const Array first_contact = s.compute_first_contact(r.decimation * kDt);
  const Array first_air = s.compute_first_air(r.decimation * kDt);
  for (int p = 0; p < kBallCount; ++p) {
    const Phases& ph = phases[p];
    ASSERT_NEAR(f("current_contact_time")[p], ph.touch ? ph.current * kDt : 0, 1e-6 * ph.current);
    ASSERT_NEAR(f("current_air_time")[p], ph.touch ? 0 : ph.current * kDt, 1e-6 * ph.current);
    ASSERT_NEAR(f("last_contact_time")[p], ph.last_contact * kDt, 1e-5);
    ASSERT_NEAR(f("last_air_time")[p], ph.last_air * kDt, 1e-5);
    ASSERT_EQ(first_contact.row<bool>(0)[p], ph.touch && ph.current <= r.decimation);
    ASSERT_EQ(first_air.row<bool>(0)[p], !ph.touch && ph.current <= r.decimation);

    bool touchdown = false, liftoff = false, any = false;
    double peak = -1, peak_dist = 0, first_touch = -1;
    for (std::size_t k = begin; k < end; ++k) {
      const bool before = k > 0 ? samples[k - 1].touch[p] : samples[0].touch[p];
      touchdown |= samples[k].touch[p] && !before;
      liftoff |= !samples[k].touch[p] && before;
      touchdowns[p] += samples[k].touch[p] && !before;
      if (!samples[k].touch[p]) continue;
      if (!any) first_touch = (k - begin + 1) * kDt;
      any = true;
      if (samples[k].force[p] > peak) {
        peak = samples[k].force[p];
        peak_dist = samples[k].dist[p];
      }
    }
    ASSERT_EQ(b("touchdown")[p], touchdown);
    ASSERT_EQ(b("liftoff")[p], liftoff);
    ASSERT_EQ(b("found_any")[p], any);
    ASSERT_NEAR(f("first_touch_time")[p], first_touch, 1e-6);
    const float* force = &f("force_peak")[3 * p];
    ASSERT_NEAR(std::hypot(force[0], force[1], force[2]), std::max(peak, 0.0), 1e-6 * (1 + peak));
    ASSERT_NEAR(f("dist_at_peak")[p], peak_dist, 1e-7);
    for (int h = 0; h < 7; ++h) {
      const bool there = static_cast<std::size_t>(h) < end;
      const Sample past = there ? samples[end - 1 - h] : Sample{};
      ASSERT_EQ(f("found_history")[p * 7 + h], past.touch[p] ? 1.0f : 0.0f);
      ASSERT_NEAR(f("force_history")[(p * 7 + h) * 3], past.force[p], 1e-6 * (1 + past.force[p]));
      ASSERT_NEAR(f("dist_history")[p * 7 + h], past.dist[p], 1e-7);
    }
  }
}

TEST(ContactTime, ExactReplayOf100000Substeps) {
  const ModelPtr model = compile_mjcf(kBalls);
  const DataPtr data = make_data(model.get());
  const mjModel* m = model.get();
  mjData* d = data.get();
  mj_forward(m, d);
  std::vector<Replayed> sensors;
  for (int decimation : {1, 3, 4, 10, 20}) {
    sensors.push_back({decimation, make_sensor(m, decimation)});
    sensors.back().sensor->reset({0, m, d});
  }
  std::mt19937 random(5);
  std::normal_distribution<double> kick(0.0, 15.0);
  std::vector<Sample> samples;
  Phases phases[kBallCount];
  int touchdowns[5][kBallCount] = {};
  int single = 0;
  for (int k = 0; k < 100000; ++k) {
    for (int p = 0; p < kBallCount; ++p) {
      if (k % 3 == 0) d->qfrc_applied[p] = kick(random);
    }
    mj_step(m, d);
    mj_forward(m, d);
    Sample sample{};
    for (int i = 0; i < d->ncon; ++i) {
      const int p = d->contact[i].geom[1] - 1;
      mjtNum f[6];
      mj_contactForce(m, d, i, f);
      sample.touch[p] = true;
      sample.force[p] = mju_norm3(f);
      sample.dist[p] = d->contact[i].dist;
    }
    samples.push_back(sample);
    for (int p = 0; p < kBallCount; ++p) {
      advance(phases[p], sample.touch[p], k == 0);
      single += k > 1 && !sample.touch[p] && samples[k - 1].touch[p] && !samples[k - 2].touch[p];
    }
    World world{0, m, d, k + 1, k + 1};
    world.moment = k + 1;
    for (std::size_t i = 0; i < sensors.size(); ++i) {
      sensors[i].sensor->substep(world);
      if ((k + 1) % sensors[i].decimation != 0) continue;
      check(sensors[i], samples, phases, touchdowns[i]);
      if (HasFatalFailure()) FAIL() << "substep " << k << ", decimation " << sensors[i].decimation;
    }
  }
  // The test covers enough: many contacts, some of a single substep, compared at every decimation.
  EXPECT_GT(touchdowns[0][0] + touchdowns[0][1], 1000);
  EXPECT_GT(single, 0);
}

TEST(ContactTime, StartInContactIsNotATouchdownAndResetClears) {
  const ModelPtr model = compile_mjcf(kBalls);
  const DataPtr data = make_data(model.get());
  const mjModel* m = model.get();
  mjData* d = data.get();
  d->qpos[1] = -0.001;
  mj_forward(m, d);
  auto s = make_sensor(m, 4);
  s->reset({0, m, d});
  s->substep({0, m, d});
  EXPECT_FALSE(s->field("touchdown").data.row<bool>(0)[1]);
  EXPECT_TRUE(s->field("found_any").data.row<bool>(0)[1]);
  EXPECT_FLOAT_EQ(s->field("current_contact_time").data.row<float>(0)[1], 0.002f);
  s->reset({0, m, d});
  for (const char* name : {"current_air_time", "last_air_time", "current_contact_time",
                           "last_contact_time", "force_history", "found_history", "force_peak"}) {
    for (float x : s->field(name).data.row<float>(0)) EXPECT_EQ(x, 0) << name;
  }
  EXPECT_EQ(s->field("first_touch_time").data.row<float>(0)[1], -1);
}

// Phases begin with the first substep of an episode, whatever the state at the reset, because a
// pose is often written after it. mjlab's timers do the same.
TEST(ContactTime, FirstSubstepAfterAResetIsNotAnEvent) {
  const ModelPtr model = compile_mjcf(kBalls);
  const DataPtr data = make_data(model.get());
  const mjModel* m = model.get();
  mjData* d = data.get();
  auto s = make_sensor(m, 1);
  const auto flag = [&](const char* name, int p) { return s->field(name).data.row<bool>(0)[p]; };
  const auto touch = [&](bool a, bool b) {
    d->qpos[0] = a ? -0.201 : 0.0;
    d->qpos[1] = b ? -0.001 : 0.1;
    mj_forward(m, d);
  };
  for (const bool before : {true, false}) {
    touch(before, before);
    s->reset({0, m, d});
    touch(true, false);
    s->substep({0, m, d});
    for (int p : {0, 1}) {
      EXPECT_FALSE(flag("touchdown", p)) << before << p;
      EXPECT_FALSE(flag("liftoff", p)) << before << p;
      EXPECT_EQ(s->field("last_air_time").data.row<float>(0)[p], 0);
      EXPECT_EQ(s->field("last_contact_time").data.row<float>(0)[p], 0);
    }
    EXPECT_TRUE(flag("found_any", 0));
    EXPECT_TRUE(s->compute_first_contact(kDt).row<bool>(0)[0]);
    EXPECT_TRUE(s->compute_first_air(kDt).row<bool>(0)[1]);

    touch(false, true);
    s->substep({0, m, d});
    EXPECT_TRUE(flag("liftoff", 0));
    EXPECT_TRUE(flag("touchdown", 1));
    EXPECT_FLOAT_EQ(s->field("last_contact_time").data.row<float>(0)[0], 0.004f);
    EXPECT_FLOAT_EQ(s->field("last_air_time").data.row<float>(0)[1], 0.004f);
  }
}

}  // namespace
}  // namespace mjsense::sensors
