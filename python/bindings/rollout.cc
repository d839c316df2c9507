// SPDX-License-Identifier: Apache-2.0
// Episodes in Python: recording them, and playing them with the caller's actions.

#include "mjsense/rollout/rollout.h"

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "mjsense/rollout/record_job.h"
#include "mjsense/rollout/registry.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/py_simulation.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {

namespace {

// Python's sensors as members of a rollout's suite, and the Python simulation that they see. C++
// copies and destroys its configuration without the interpreter's lock, so it holds this by a
// pointer.
struct PythonMembers {
  nb::list sensors;
  nb::object make_simulation;
  nb::object simulation;

  // Nothing of Python's may hold on to a rollout that has ended.
  void close() {
    if (simulation) simulation.attr("close")();
  }
};

std::vector<std::shared_ptr<Sensor>> make_members(PythonMembers& members,
                                                  const std::shared_ptr<Simulation>& sim) {
  nb::gil_scoped_acquire lock;
  auto* shared = new PySimulation(sim);
  members.simulation = members.make_simulation(nb::cast(shared, nb::rv_policy::take_ownership));
  std::vector<std::shared_ptr<Sensor>> made;
  for (nb::handle object : members.sensors) {
    auto sensor = std::make_shared<PythonSensor>(nb::cast<std::string>(object.attr("uuid")),
                                                 WeakObject(object), read_python_spec(object));
    sensor->on_initialized = [weak = std::weak_ptr<PythonSensor>(sensor), &members] {
      auto self = weak.lock();
      self->self().attr("_mjs_bind")(members.simulation, SensorHandle{self});
    };
    shared->add_python(sensor);
    made.push_back(sensor);
  }
  return made;
}

nb::dict progress_dict(const RecordProgress& p) {
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

nb::dict record(nb::dict options, nb::object progress, nb::list sensors,
                nb::object make_simulation) {
  RecordJobCfg cfg;
  read_options(options, struct_of<RecordJobCfg>(), &cfg);
  PythonMembers members{sensors, make_simulation, {}};
  if (sensors.size() > 0) {
    cfg.rollout.more_sensors = [&members](const auto& sim) { return make_members(members, sim); };
  }
  StopFlag stop{0};
  nb::object error;  // of `progress`, or KeyboardInterrupt
  const auto report = [&](const RecordProgress& p) {
    nb::gil_scoped_acquire lock;
    if (error) return;
    try {
      if (PyErr_CheckSignals() != 0) throw nb::python_error();
      if (!progress.is_none()) progress(progress_dict(p));
    } catch (nb::python_error& e) {
      error = nb::borrow(e.value());
      stop = 2;
    }
  };
  RecordSummary s;
  try {
    nb::gil_scoped_release unlock;
    s = record_episodes(cfg, report, &stop);
  } catch (...) {
    members.close();
    throw;
  }
  members.close();
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
  d["path"] = s.house_dir.string();
  return d;
}

// B worlds that play episodes with actions from Python.
class PyRollout {
 public:
  explicit PyRollout(nb::dict options) {
    RolloutCfg cfg;
    read_options(options, struct_of<RolloutCfg>(), &cfg);
    nb::gil_scoped_release unlock;
    rollout_ = std::make_shared<Rollout>(cfg);
  }
  ~PyRollout() {
    nb::gil_scoped_release unlock;
    rollout_.reset();
  }

  Rollout& rollout() { return *rollout_; }
  const std::shared_ptr<Rollout>& share() const { return rollout_; }

  // The worlds as a simulation, which takes turns with the rollout.
  PySimulation* simulation() const { return new PySimulation(rollout_->simulation_ptr(), turns_); }

  void start(const std::vector<int>& worlds, const std::vector<std::int64_t>& episodes) {
    turns_->change("start", [&] { rollout_->start(worlds, episodes); });
  }
  void stop(int world) {
    turns_->change("stop", [&] { rollout_->stop(world); });
  }
  void act() {
    turns_->change("act", [&] { rollout_->act(); });
  }
  void step() {
    turns_->change("step", [&] { rollout_->step(); });
  }

  // Commands of all controlled groups in a row, [B, n].
  using Commands = nb::ndarray<const double, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
  void set_actions(const Commands& values) {
    const auto& groups = rollout_->task().robot().groups();
    std::size_t width = 0;
    for (const MoveGroup& group : groups) width += group.actuators.size();
    if (values.shape(0) != static_cast<std::size_t>(rollout_->num_worlds()) ||
        values.shape(1) != width) {
      throw ValueError(fmt::format("actions: shape ({}, {}), expected ({}, {})", values.shape(0),
                                   values.shape(1), rollout_->num_worlds(), width));
    }
    const double* at = values.data();
    turns_->change("set_actions", [&] {
      for (int w = 0; w < rollout_->num_worlds(); ++w) {
        Action action;
        for (std::size_t g = 0; g < groups.size(); ++g) {
          const std::size_t n = groups[g].actuators.size();
          if (n > 0) action.commands[g].set({at, n});
          at += n;
        }
        rollout_->action(w) = action;
      }
    });
  }
  std::vector<std::vector<double>> actions() {
    const auto& groups = rollout_->task().robot().groups();
    std::vector<std::vector<double>> rows(rollout_->num_worlds());
    turns_->read([&] {
      for (int w = 0; w < rollout_->num_worlds(); ++w) {
        for (std::size_t g = 0; g < groups.size(); ++g) {
          const GroupValues& given = rollout_->action(w).commands[g];
          const GroupValues& held = rollout_->task().robot().targets(w)[g];
          for (std::size_t k = 0; k < groups[g].actuators.size(); ++k)
            rows[w].push_back((given.given ? given : held).values[k]);
        }
      }
    });
    return rows;
  }
  // The evaluation of a world and why it failed, if it did.
  std::pair<Evaluation, std::string> outcome(int world) {
    std::pair<Evaluation, std::string> found;
    turns_->read([&] { found = {rollout_->evaluation(world), rollout_->fault(world)}; });
    return found;
  }

 private:
  std::shared_ptr<Rollout> rollout_;
  std::shared_ptr<Turns> turns_ = std::make_shared<Turns>();
};

nb::list action_layout(PyRollout& self) {
  nb::list layout;
  for (const MoveGroup& group : self.rollout().task().robot().groups()) {
    if (group.controlled())
      layout.append(nb::make_tuple(group.name, group.ctrl_low, group.ctrl_high));
  }
  return layout;
}

nb::list streams(PyRollout& self) {
  nb::list list;
  for (const auto& sensor : self.rollout().suite().sensors()) {
    nb::object owner = owner_of(std::shared_ptr<Sensor>(self.share(), sensor.get()));
    for (Field& field : sensor->fields()) {
      list.append(nb::make_tuple(sensor->name(), nb::cast(field.spec, nb::rv_policy::copy),
                                 to_readonly_numpy(field.data.view(), owner)));
    }
  }
  return list;
}

nb::tuple outcome(PyRollout& self, int w) {
  Rollout& r = self.rollout();
  if (w < 0 || w >= r.num_worlds())
    throw ValueError(fmt::format("world {}: must be in [0, {})", w, r.num_worlds()));
  const auto [e, fault] = self.outcome(w);
  return nb::make_tuple(e.reward, e.success, e.terminal, e.truncated, fault);
}

}  // namespace

void bind_rollout(nb::module_& m) {
  m.def("record", &record, nb::arg("options"), nb::arg("progress").none(), nb::arg("sensors"),
        nb::arg("make_simulation"));
  m.def("task_names", &task_names, "Names of the tasks there are.");
  m.def("robot_names", &robot_names, "Names of the robots there are.");
  m.def("policy_names", &policy_names, "Names of the policies there are.");
  nb::class_<PyRollout>(m, "Rollout", "The C++ rollout.")
      .def(nb::init<nb::dict>(), nb::arg("options"))
      .def("start", &PyRollout::start, nb::arg("worlds"), nb::arg("episodes"))
      .def("stop", &PyRollout::stop, nb::arg("world"))
      .def("act", &PyRollout::act)
      .def("step", &PyRollout::step)
      .def("set_actions", &PyRollout::set_actions, nb::arg("values"))
      .def("actions", &PyRollout::actions)
      .def("action_layout", &action_layout)
      .def("streams", &streams, "(sensor, spec, array) of every stream")
      .def("outcome", &outcome, nb::arg("world"), "(reward, success, terminal, truncated, fault)")
      .def(
          "description", [](PyRollout& s, int w) { return s.rollout().task().description(w); },
          nb::arg("world"))
      .def_prop_ro("fps", [](PyRollout& s) { return s.rollout().task().fps(); })
      .def("simulation", &PyRollout::simulation, nb::rv_policy::take_ownership);
}

}  // namespace mjsense::python
