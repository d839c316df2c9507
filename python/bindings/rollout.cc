// SPDX-License-Identifier: Apache-2.0
// Bindings of episodes: recording them, and playing them with the caller's actions.

#include "mjsense_tasks/rollout/rollout.h"

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <numeric>

#include "mjsense/core/fields/fields.h"
#include "mjsense/core/text/counted.h"
#include "mjsense_tasks/rollout/record_job.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/scenes/scene_file.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/mujoco_callbacks.h"
#include "python/bindings/numpy.h"
#include "python/bindings/python_policy.h"
#include "python/bindings/python_task.h"
#include "python/bindings/rollout_host.h"
#include "python/bindings/sensor_handle.h"
#include "python/bindings/stop_on_signal.h"

namespace mjsense::python {

namespace {

// The Python objects of a rollout. `parts` is a tuple: a task or None, a policy or None, sensors, a
// scene or None, the dependencies of their code (RolloutCfg::code), sensors of the robot, and None
// or a function that selects among [(sensor, owner)]. Sensors are a list, or a function that
// creates the list for a simulation. C++ may copy and destroy its configuration without the GIL.
class Parts {
 public:
  Parts(nb::object parts, nb::object make_simulation)
      : host_(std::make_shared<PythonHost>(std::move(make_simulation))),
        task_(nb::object(parts[0])),
        policy_(nb::object(parts[1])),
        sensors_(nb::object(parts[2])),
        scene_(nb::object(parts[3])),
        code_(nb::cast<decltype(code_)>(parts[4])),
        robot_sensors_(nb::object(parts[5])),
        select_(nb::object(parts[6])) {}

  const std::shared_ptr<PythonHost>& host() const { return host_; }

  void join(tasks::rollout::RolloutCfg& cfg) const {
    cfg.code = code_;
    if (!task_.get().is_none()) {
      const bool own_horizon = !cfg.horizon;
      cfg.make_task = [task = task_, host = host_, own_horizon](tasks::episode::TaskCfg wanted) {
        nb::gil_scoped_acquire lock;
        return PythonTask::make(nb::borrow(task.get()), host, std::move(wanted), own_horizon);
      };
    }
    if (!policy_.get().is_none()) {
      cfg.make_policy = [policy = policy_, host = host_] {
        nb::gil_scoped_acquire lock;
        return std::make_unique<PythonPolicy>(nb::borrow(policy.get()), host);
      };
    }
    if (!scene_.get().is_none()) {
      cfg.make_scene = [scene = scene_, host = host_] {
        nb::gil_scoped_acquire lock;
        return read_scene_file(nb::borrow(scene.get()), host);
      };
    }
    const auto members = [host = host_](const PyHandle& sensors) {
      return [sensors, host](tasks::rollout::Rollout& rollout) {
        nb::gil_scoped_acquire lock;
        return host->members(sensors.get(), rollout.simulation_ptr());
      };
    };
    const auto are_there = [](const PyHandle& sensors) {
      return PyCallable_Check(sensors.get().ptr()) || nb::len(sensors.get()) > 0;
    };
    if (are_there(sensors_)) cfg.more_sensors = members(sensors_);
    if (are_there(robot_sensors_)) cfg.robot_sensors = members(robot_sensors_);
    if (!select_.get().is_none()) {
      cfg.edit_suite = [select = select_](observe::SensorSuite& suite) {
        nb::gil_scoped_acquire lock;
        nb::list known;
        for (const std::string& name : suite.names())
          known.append(nb::make_tuple(name, suite.owner(name)));
        suite.select(nb::cast<std::vector<std::string>>(nb::borrow(select.get())(known)));
      };
    }
    cfg.on_construct_begin = [host = host_](tasks::rollout::Rollout& rollout) {
      host->set_rollout(rollout);
    };
    cfg.on_constructed = [](tasks::rollout::Rollout& rollout) {
      if (auto* policy = dynamic_cast<PythonPolicy*>(rollout.policy())) policy->observe(rollout);
    };
  }

 private:
  std::shared_ptr<PythonHost> host_;
  // Reads the configuration, including a Python function that creates its models.
  static tasks::scenes::SceneFileCfg read_scene_file(nb::object scene,
                                                     const std::shared_ptr<PythonHost>& host) {
    tasks::scenes::SceneFileCfg cfg;
    read_struct(scene, cfg);
    if (!scene.attr("models").is_none()) {
      cfg.models = [scene = PyHandle(scene), host,
                    context = fmt::format("scene '{}': models()", cfg.name)] {
        return host->call(context,
                          [&] { return host->read_prepared(scene.get().attr("_mjs_scene")()); });
      };
    }
    return cfg;
  }

  PyHandle task_, policy_, sensors_, scene_;
  decltype(tasks::rollout::RolloutCfg::code) code_;
  PyHandle robot_sensors_, select_;
};

nb::dict progress_dict(const tasks::rollout::RecordProgress& p) {
  nb::dict d;
  d["kept"] = p.kept;
  d["wanted"] = p.wanted;
  d["running"] = p.running;
  d["succeeded"] = p.succeeded;
  d["failed"] = p.failed;
  d["steps"] = p.steps;
  d["physics_steps"] = p.physics_steps;
  d["frames"] = p.frames;
  d["seconds"] = p.seconds;
  d["seconds_left"] = p.seconds_left();
  return d;
}

// With `stop_on_signals`, Ctrl-C and SIGTERM end the recording as in StopOnSignal, and `progress`
// gets the number of signals too.
nb::dict record(nb::dict options, nb::object progress, nb::object objects,
                nb::object make_simulation, bool stop_on_signals) {
  tasks::rollout::RecordJobCfg cfg;
  read_options(options, struct_of<tasks::rollout::RecordJobCfg>(), &cfg);
  const Parts parts(objects, make_simulation);
  parts.join(cfg.rollout);
  const StopOnSignal signals(stop_on_signals);
  tasks::rollout::StopFlag own_stop{0};
  tasks::rollout::StopFlag& stop = stop_on_signals ? StopOnSignal::flag : own_stop;
  nb::object error;  // raised by `progress`, or KeyboardInterrupt
  const auto report = [&](const tasks::rollout::RecordProgress& p) {
    nb::gil_scoped_acquire lock;
    if (error) return;
    try {
      if (PyErr_CheckSignals() != 0) throw nb::python_error();
      if (!progress.is_none() && stop_on_signals) {
        progress(progress_dict(p), stop.load());
      } else if (!progress.is_none()) {
        progress(progress_dict(p));
      }
    } catch (nb::python_error& e) {
      error = nb::borrow(e.value());
      stop = 2;
    }
  };
  tasks::rollout::RecordSummary s;
  refuse_python_callbacks();
  try {
    nb::gil_scoped_release unlock;
    // User code that runs inside may read the worlds but not step or reset them.
    parts.host()->sim_lock()->work(
        [&] { s = tasks::rollout::record_episodes(cfg, report, &stop); });
  } catch (...) {
    parts.host()->close();
    throw;
  }
  parts.host()->close();
  if (error) {
    PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(error.ptr())), error.ptr());
    throw nb::python_error();
  }
  nb::dict d = progress_dict(s.progress);
  d["interrupted"] = s.interrupted;
  d["enough"] = s.enough;
  nb::dict failures;
  for (const auto& [why, count] : s.failures) failures[why.c_str()] = count;
  d["failures"] = failures;
  d["lengths"] = s.lengths;
  nb::dict times;
  times["policy"] = s.times.policy;
  times["physics"] = s.times.physics;
  times["sensing"] = s.times.sensing;
  times["rendering"] = s.times.rendering;
  times["reset"] = s.times.reset;
  times["recording"] = s.recording_s;
  d["times"] = times;
  d["published_bytes"] = s.record.published_bytes;
  d["path"] = nb::cast(s.house_dir);
  nb::dict work;  // in addition to the simulation, for the program
  work["encode_cpu_s"] = s.record.encode_cpu_s;
  work["write_s"] = s.record.write_s + s.record.commit_s;
  work["raw_bytes"] = s.record.raw_bytes;
  work["damage"] = s.damage;
  d["work"] = work;
  return d;
}

// B worlds that play episodes with actions from Python.
class PyRollout {
 public:
  PyRollout(nb::dict options, nb::object objects, nb::object make_simulation)
      : parts_(objects, make_simulation), sim_lock_(parts_.host()->sim_lock()) {
    refuse_python_callbacks();
    tasks::rollout::RolloutCfg cfg;
    cfg.default_view = nb::cast<bool>(options.attr("pop")("default_view", false));
    cfg.replay_sensor = nb::cast<bool>(options.attr("pop")("replay_sensor", false));
    read_options(options, struct_of<tasks::rollout::RolloutCfg>(), &cfg);
    parts_.join(cfg);
    nb::gil_scoped_release unlock;
    try {
      rollout_ = make_shared_guarded<tasks::rollout::Rollout>(cfg);
    } catch (...) {
      parts_.host()->end();
      throw;
    }
  }
  ~PyRollout() {
    parts_.host()->end();
    nb::gil_scoped_release unlock;
    rollout_.reset();
  }

  tasks::rollout::Rollout& rollout() { return *rollout_; }
  // mjsense.Simulation of the worlds, which shares the rollout's lock.
  nb::object simulation() const { return parts_.host()->simulation(rollout_->simulation_ptr()); }

  void start(const std::vector<int>& worlds, const std::vector<std::int64_t>& episodes) {
    sim_lock_->change("start", [&] { rollout_->start(worlds, episodes); });
  }
  void stop(int world) {
    sim_lock_->change("stop", [&] { rollout_->stop(world); });
  }
  void act() {
    sim_lock_->change("act", [&] { rollout_->act(); });
  }
  void step() {
    sim_lock_->change("step", [&] { rollout_->step(); });
  }
  // (world, written, ctrl or None, mocap or None) of recorded steps.
  using Row = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
  void repeat(
      const std::vector<std::tuple<int, Row, std::optional<Row>, std::optional<Row>>>& steps) {
    std::vector<tasks::rollout::Rollout::RecordedStep> recorded;
    const auto span = [](const Row& row) { return std::span(row.data(), row.size()); };
    const mjModel* m = rollout_->simulation().model();
    const auto state = static_cast<std::size_t>(mj_stateSize(m, mjSTATE_INTEGRATION));
    for (const auto& [world, written, ctrl, mocap] : steps) {
      if (world < 0 || world >= rollout_->num_worlds() || written.size() != state)
        throw ValueError(fmt::format("repeat: world {}, {} numbers of the state, which has {}",
                                     world, written.size(), state));
      recorded.push_back({world, span(written), ctrl ? span(*ctrl) : std::span<const double>(),
                          mocap ? span(*mocap) : std::span<const double>()});
    }
    sim_lock_->change("repeat", [&] { rollout_->repeat(recorded); });
  }
  void reseed(std::uint64_t seed) {
    sim_lock_->change("reseed", [&] { rollout_->reseed(seed); });
  }

  // Commands of all controlled groups, concatenated, [B, n]. `done` [B]: the episode ends after
  // this step.
  using Commands = nb::ndarray<const double, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
  using Flags = nb::ndarray<const bool, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
  void set_actions(const Commands& values, std::optional<Flags> done) {
    check(values.shape(0), values.shape(1), "(B, n)");
    if (done && done->size() != values.shape(0))
      throw ValueError(fmt::format("done: {} for {}", counted(done->size(), "flag"),
                                   counted(values.shape(0), "world")));
    const double* at = values.data();
    const bool* flags = done ? done->data() : nullptr;
    sim_lock_->change("set_actions", [&] {
      for (int w = 0; w < rollout_->num_worlds(); ++w) {
        rollout_->action(w) = action(at + w * width());
        if (flags) rollout_->action(w).done = flags[w];
      }
    });
  }
  // Chunks of actions, [B, steps, n].
  using Chunks = nb::ndarray<const double, nb::shape<-1, -1, -1>, nb::c_contig, nb::device::cpu>;
  void step_chunk(const Chunks& values, bool stop_on_success) {
    check(values.shape(0), values.shape(2), "(B, steps, n)");
    const std::size_t B = values.shape(0), steps = values.shape(1);
    std::vector<tasks::robots::Action> actions(B * steps);
    for (std::size_t w = 0; w < B; ++w) {
      for (std::size_t k = 0; k < steps; ++k)
        actions[k * B + w] = action(values.data() + (w * steps + k) * width());
    }
    sim_lock_->change("step_chunk", [&] { rollout_->step_chunk(actions, stop_on_success); });
  }
  // (phase, positions [N, 3] in the world frame) of each part of the policy's plan in a world.
  nb::list planned_paths(int world) {
    std::vector<tasks::episode::PlannedPath> paths;
    sim_lock_->read([&] {
      if (rollout_->policy() == nullptr || !rollout_->active(world)) return;
      const std::array<int, 1> ids{world};
      rollout_->for_each(ids,
                         [&](const World& w) { paths = rollout_->policy()->planned_paths(w); });
    });
    nb::list out;
    for (const tasks::episode::PlannedPath& path : paths) {
      const auto rows =
          std::make_shared<Array>(DType::kFloat64, Shape{static_cast<int>(path.poses.size()), 3});
      double* row = rows->all<double>().data();
      for (const Pose& pose : path.poses) {
        write_vec(pose.p, row);
        row += 3;
      }
      out.append(nb::make_tuple(std::string(path.phase), to_numpy(rows->view(), owner_of(rows))));
    }
    return out;
  }
  // Actions that act() chose, [B, n], and the worlds for which the policy reported done.
  nb::tuple actions() {
    std::vector<std::vector<double>> rows(rollout_->num_worlds());
    std::vector<int> done(rollout_->num_worlds()), all(rollout_->num_worlds());
    std::iota(all.begin(), all.end(), 0);
    sim_lock_->read([&] {
      rollout_->for_each(all, [&](const World& world) {
        rows[world.id] = rollout_->task().robot().commands(world, rollout_->action(world.id));
        done[world.id] = rollout_->action(world.id).done;
      });
    });
    return nb::make_tuple(rows, done);
  }
  template <class Body>
  void read(Body&& body) {
    sim_lock_->read([&] { body(*rollout_); });
  }

 private:
  std::size_t width() const {
    std::size_t width = 0;
    for (const tasks::robots::MoveGroup& group : rollout_->task().robot().groups())
      width += group.command_size;
    return width;
  }
  void check(std::size_t worlds, std::size_t width, const char* what) const {
    if (worlds == static_cast<std::size_t>(rollout_->num_worlds()) && width == this->width())
      return;
    throw ValueError(fmt::format("actions: {} of {}, expected {} = {} of {}",
                                 counted(worlds, "world"), counted(width, "command"), what,
                                 counted(rollout_->num_worlds(), "world"), this->width()));
  }
  tasks::robots::Action action(const double* commands) const {
    tasks::robots::Action action;
    const auto groups = rollout_->task().robot().groups();
    for (std::size_t g = 0; g < groups.size(); ++g) {
      const std::size_t n = groups[g].command_size;
      if (n > 0) action.commands[static_cast<int>(g)].set({commands, n});
      commands += n;
    }
    return action;
  }

  Parts parts_;
  std::shared_ptr<SimulationLock> sim_lock_;
  std::shared_ptr<tasks::rollout::Rollout> rollout_;
};

// (reward, success, terminal, truncated), each [B], and {world: fault}.
nb::tuple outcomes(PyRollout& self) {
  const int B = self.rollout().num_worlds();
  const auto make = [&](DType dtype) { return std::make_shared<Array>(dtype, Shape{B}); };
  const auto reward = make(DType::kFloat64), success = make(DType::kBool),
             terminal = make(DType::kBool), truncated = make(DType::kBool);
  std::vector<std::pair<int, std::string>> faults;
  self.read([&](tasks::rollout::Rollout& rollout) {
    for (int w = 0; w < B; ++w) {
      const tasks::episode::Evaluation& e = rollout.evaluation(w);
      reward->all<double>()[w] = e.reward;
      success->all<bool>()[w] = e.success;
      terminal->all<bool>()[w] = e.terminal;
      truncated->all<bool>()[w] = e.truncated;
      if (!rollout.fault(w).empty()) faults.emplace_back(w, rollout.fault(w));
    }
  });
  nb::dict why;
  for (const auto& [w, text] : faults) why[nb::int_(w)] = text;
  const auto numpy = [](const std::shared_ptr<Array>& a) {
    return to_numpy(a->view(), owner_of(a));
  };
  return nb::make_tuple(numpy(reward), numpy(success), numpy(terminal), numpy(truncated), why);
}

}  // namespace

void bind_rollout(nb::module_& m) {
  m.def("record", &record, nb::arg("options"), nb::arg("progress").none(), nb::arg("objects"),
        nb::arg("make_simulation"), nb::arg("stop_on_signals"));
  m.def(
      "resolved_job",
      [](nb::dict options) {
        tasks::rollout::RecordJobCfg cfg;
        read_options(options, struct_of<tasks::rollout::RecordJobCfg>(), &cfg);
        const tasks::rollout::RecordJobCfg job = tasks::rollout::without_shard(cfg);
        const tasks::rollout::RolloutCfg resolved = tasks::rollout::resolved(job.rollout);
        return nb::make_tuple(resolved.task, resolved.robot, resolved.scene, job.num_attempts,
                              job.out);
      },
      nb::arg("options"),
      "Task, robot and scene of a recording, its number of attempts, and the directory of its "
      "shard.");
  m.def("task_names", &tasks::rollout::task_names, "Names of the tasks there are.");
  m.def("robot_names", &tasks::robots::robot_names, "Names of the robots there are.");
  m.def("policy_names", &tasks::rollout::policy_names, "Names of the policies there are.");
  nb::class_<PyRollout>(m, "Rollout", "The C++ rollout.")
      .def(nb::init<nb::dict, nb::object, nb::object>(), nb::arg("options"), nb::arg("objects"),
           nb::arg("make_simulation"))
      .def("start", &PyRollout::start, nb::arg("worlds"), nb::arg("episodes"))
      .def("stop", &PyRollout::stop, nb::arg("world"))
      .def("act", &PyRollout::act)
      .def("step", &PyRollout::step)
      .def("repeat", &PyRollout::repeat, nb::arg("steps"), "Repeats recorded control steps.")
      .def("reseed", &PyRollout::reseed, nb::arg("seed"))
      .def("step_chunk", &PyRollout::step_chunk, nb::arg("values"), nb::arg("stop_on_success"))
      .def("set_actions", &PyRollout::set_actions, nb::arg("values"), nb::arg("done") = nb::none())

      .def("actions", &PyRollout::actions)
      .def("planned_paths", &PyRollout::planned_paths, nb::arg("world"))
      .def("action_layout", [](PyRollout& s) { return action_layout(s.rollout().task().robot()); })
      .def(
          "streams", [](PyRollout& s) { return suite_streams(s.rollout()); },
          "(sensor, spec, array) of every stream")
      .def(
          "sensors",
          [](PyRollout& s) {
            nb::list list;
            observe::SensorSuite& suite = s.rollout().suite();
            for (const auto& sensor : suite.sensors())
              list.append(nb::make_tuple(SensorHandle{sensor}, suite.owner(sensor->name())));
            return list;
          },
          "(handle, owner) of every sensor; valid while the rollout exists")
      .def("outcomes", &outcomes, "(reward, success, terminal, truncated, {world: fault})")
      .def(
          "obs_scene", [](PyRollout& s, int w) { return s.rollout().obs_scene(w); },
          nb::arg("world"))
      .def(
          "start_text",
          [](PyRollout& s, int w) {
            std::string text;
            s.read([&](tasks::rollout::Rollout& rollout) { text = rollout.start_text(w); });
            return text;
          },
          nb::arg("world"),
          "The start of the world's episode, at its first observation, as JSON text.")
      .def(
          "instruction", [](PyRollout& s, int w) { return s.rollout().task().instruction(w); },
          nb::arg("world"))
      .def(
          "object",
          [](PyRollout& s, int w) {
            const auto objects = s.rollout().task().objects(w);
            return objects.empty() ? std::string() : objects.front().name;
          },
          nb::arg("world"), "Name of the object of the world's task; empty: it has none.")
      .def_prop_ro("fps", [](PyRollout& s) { return s.rollout().task().fps(); })
      .def_prop_ro("horizon", [](PyRollout& s) { return s.rollout().task().cfg().horizon; })
      .def("simulation", &PyRollout::simulation);
}

}  // namespace mjsense::python
