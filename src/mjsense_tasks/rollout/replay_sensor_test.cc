// SPDX-License-Identifier: Apache-2.0
// Episodes must replay bit for bit in plain MuJoCo, from the recorded rows and the archived model.
#include "mjsense_tasks/rollout/replay_sensor.h"

#include <gmock/gmock.h>
#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>
#include <vector>

#include "mjsense/core/testing/unzip.h"
#include "mjsense/record/model_checksums.h"
#include "mjsense/record/model_fields.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/model_archive.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::tasks::rollout {
namespace {

// What a recording stores of one episode.
struct Recorded {
  std::vector<std::vector<double>> state, written, ctrl, mocap;
  std::vector<record::EpisodeArray> model;
  std::vector<int> held;
};

std::vector<double> row_of(const Sensor& sensor, const char* field) {
  for (const Field& f : sensor.fields()) {
    if (f.name != field) continue;
    const auto row = f.data.row<double>(0);
    return {row.begin(), row.end()};
  }
  return {};
}

void append(const Sensor& replay, Recorded& out) {
  out.state.push_back(row_of(replay, "state"));
  out.written.push_back(row_of(replay, "written"));
  out.ctrl.push_back(row_of(replay, "ctrl"));
  out.mocap.push_back(row_of(replay, "mocap"));
}

ModelPtr model_from(const scene::Scene& scene) {
  scene::Vfs vfs;
  std::string xml;
  for (const auto& [name, bytes] : unzip(scene::model_archive(scene))) {
    if (name == scene::kArchivedModel) xml = bytes;
    if (name != scene::kArchivedModel) vfs.add(name, bytes, "test");
  }
  char error[1000] = "";
  const scene::SpecPtr spec(mj_parseXMLString(xml.c_str(), vfs.get(), error, sizeof error));
  EXPECT_TRUE(spec) << error;
  return scene::compile(spec.get(), vfs);
}

// Writes the values that are not NaN.
template <class T>
void write(const record::EpisodeArray& array, T* to) {
  for (std::size_t i = 0; i < array.values.size() / sizeof(T); ++i) {
    T value;
    std::memcpy(&value, array.values.data() + i * sizeof(T), sizeof(T));
    if constexpr (std::is_floating_point_v<T>) {
      if (std::isnan(value)) continue;
    }
    to[i] = value;
  }
}

void write_model(const std::vector<record::EpisodeArray>& arrays, mjModel* m) {
  for (const record::EpisodeArray& array : arrays) {
#define X(type, name, rows, columns) \
  if (array.path == "model/" #name) write(array, m->name);
    MJMODEL_POINTERS
#undef X
  }
}

// Steps open loop and returns the number of the first row that differs, or -1.
int first_difference(const Recorded& recorded, const mjModel* m, int substeps) {
  const DataPtr owned = make_data(m);
  mjData* d = owned.get();
  std::vector<double> state = recorded.state[0];
  int different = -1;
  for (std::size_t t = 1; t < recorded.state.size() && different < 0; ++t) {
    for (std::size_t i = 0; i < state.size(); ++i) {
      if (!std::isnan(recorded.written[t][i])) state[i] = recorded.written[t][i];
    }
    mj_setState(m, d, state.data(), mjSTATE_INTEGRATION);
    std::vector<double> poses;
    for (int joint : recorded.held)
      poses.insert(poses.end(), d->qpos + m->jnt_qposadr[joint],
                   d->qpos + m->jnt_qposadr[joint] + 7);
    const int ticks =
        recorded.ctrl[t].empty() ? 1 : static_cast<int>(recorded.ctrl[t].size()) / m->nu;
    for (int k = 0; k < substeps; ++k) {
      const int every = substeps / ticks;
      if (ticks > 1 && k % every == 0) {
        std::copy_n(recorded.ctrl[t].data() + k / every * m->nu, m->nu, d->ctrl);
        for (int i = 0; i < (recorded.mocap[t].empty() ? 0 : m->nmocap); ++i) {
          const double* pose = recorded.mocap[t].data() + (k / every * m->nmocap + i) * 7;
          std::copy_n(pose, 3, d->mocap_pos + 3 * i);
          std::copy_n(pose + 3, 4, d->mocap_quat + 4 * i);
        }
      }
      mj_step(m, d);
      for (std::size_t i = 0; i < recorded.held.size(); ++i) {
        std::copy_n(poses.data() + 7 * i, 7, d->qpos + m->jnt_qposadr[recorded.held[i]]);
        std::fill_n(d->qvel + m->jnt_dofadr[recorded.held[i]], 6, 0.0);
      }
    }
    mj_getState(m, d, state.data(), mjSTATE_INTEGRATION);
    if (std::memcmp(state.data(), recorded.state[t].data(), state.size() * sizeof(double)) != 0)
      different = static_cast<int>(t);
  }
  return different;
}

Recorded play(Rollout& rollout, int steps) {
  const int world = 0;
  const std::int64_t episode = 1;
  rollout.start({&world, 1}, {&episode, 1});
  Recorded out;
  append(*rollout.replay_sensor(), out);
  for (int t = 0; t < steps; ++t) {
    rollout.act();
    rollout.step();
    EXPECT_EQ(rollout.fault(0), "");
    append(*rollout.replay_sensor(), out);
  }
  sim::Simulation& simulation = rollout.simulation();
  out.model = record::differing_fields(simulation.model_of(0), *simulation.scene().model());
  out.held = simulation.worlds().held(0);
  return out;
}

RolloutCfg cfg_of(const std::string& task, const std::string& robot) {
  RolloutCfg cfg;
  cfg.task = task;
  cfg.robot = robot;
  cfg.cameras.emplace();
  cfg.replay_sensor = true;
  return cfg;
}

void expect_replays(const RolloutCfg& cfg, int steps) {
  Rollout rollout(cfg);
  Recorded recorded = play(rollout, steps);
  const ModelPtr m = model_from(rollout.simulation().scene());
  ASSERT_TRUE(m);
  EXPECT_EQ(record::model_checksums(*m),
            record::model_checksums(*rollout.simulation().scene().model()));
  write_model(recorded.model, m.get());
  EXPECT_EQ(first_difference(recorded, m.get(), rollout.task().decimation()), -1);
  // And the test can fail.
  recorded.state[5][mj_stateSize(m.get(), mjSTATE_TIME)] += 1e-9;
  EXPECT_EQ(first_difference(recorded, m.get(), rollout.task().decimation()), 5);
}

TEST(Replay, PickWithPushes) {
  RolloutCfg cfg = cfg_of("pick", "franka");
  cfg.perturb = 1;
  expect_replays(cfg, 40);
}

TEST(Replay, RobotWithMocapBase) { expect_replays(cfg_of("pick", "floating_rum"), 25); }

TEST(Replay, ControllersThatRunSeveralTimesAStep) {
  expect_replays(cfg_of("door_opening", "rby1"), 15);
}

TEST(Replay, ScenesWithMeshFiles) { expect_replays(cfg_of("nav_to_obj", "auto"), 10); }

// Without a policy: what actions and controllers write is replaced.
void expect_repeats(RolloutCfg cfg, int steps) {
  Rollout played(cfg);
  const Recorded recorded = play(played, steps);
  cfg.policy = "";
  Rollout repeated(cfg);
  const int world = 0;
  const std::int64_t episode = 1;
  repeated.start({&world, 1}, {&episode, 1});
  EXPECT_EQ(row_of(*repeated.replay_sensor(), "state"), recorded.state[0]);
  for (int t = 1; t <= steps; ++t) {
    const Rollout::RecordedStep step{0, recorded.written[t], recorded.ctrl[t], recorded.mocap[t]};
    repeated.repeat({&step, 1});
    ASSERT_EQ(row_of(*repeated.replay_sensor(), "state"), recorded.state[t]) << t;
  }
  EXPECT_EQ(repeated.evaluation(0).reward, played.evaluation(0).reward);
}

TEST(Replay, StepsAreRepeated) {
  RolloutCfg cfg = cfg_of("pick", "franka");
  cfg.perturb = 1;
  expect_repeats(cfg, 40);
  expect_repeats(cfg_of("pick", "floating_rum"), 25);
}

TEST(Replay, StepsWithSeveralControlTicksAreRepeated) {
  expect_repeats(cfg_of("door_opening", "rby1"), 15);
}

TEST(Replay, OnlyInputsAreWritten) {
  Rollout rollout(cfg_of("pick", "franka"));
  const Recorded recorded = play(rollout, 12);
  const auto is_nan = [](double x) { return std::isnan(x); };
  EXPECT_TRUE(std::ranges::all_of(recorded.written[0], is_nan));
  const mjModel* m = rollout.simulation().model();
  const int states = mj_stateSize(m, mjSTATE_TIME | mjSTATE_QPOS | mjSTATE_QVEL | mjSTATE_ACT);
  int changed = 0;
  for (const std::vector<double>& row : recorded.written) {
    EXPECT_TRUE(std::all_of(row.begin(), row.begin() + states, is_nan));
    changed += !std::ranges::all_of(row, is_nan);
  }
  EXPECT_GT(changed, 5);  // the controls
}

TEST(Replay, APolicyDoesNotObserveTheState) {
  const RolloutCfg cfg = cfg_of("pick", "franka");
  EXPECT_EQ(Rollout(cfg).suite().find("replay"), nullptr);
}

}  // namespace
}  // namespace mjsense::tasks::rollout
