// SPDX-License-Identifier: Apache-2.0
// Bindings of simulations. python/mjsense/sim/simulation.py defines the public class.

#include "mjsense/sim/simulation.h"

#include <fmt/format.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/model_indices.h"
#include "mjsense/effects/effect_sensor.h"
#include "mjsense/scene/mujoco_log.h"
#include "mjsense/sensors/camera/camera_sensor.h"
#include "mjsense/sensors/imu/imu_sensor.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"
#include "python/bindings/bindings.h"
#include "python/bindings/data_copies.h"
#include "python/bindings/derived_field.h"
#include "python/bindings/foreign_arrays.h"
#include "python/bindings/numpy.h"
#include "python/bindings/py_simulation.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {
namespace {

using Ids = std::optional<std::vector<int>>;

// None selects all worlds.
worlds::WorldIds worlds_of(const Ids& ids) {
  return ids ? worlds::WorldIds(*ids) : worlds::WorldIds(worlds::all_worlds);
}

// Computes the values that MuJoCo derives from other fields of the model.
void set_constants(mjBatch* batch, const std::vector<int>& ids) {
  const int failed = mjb_setConst(batch, ids.data(), static_cast<int>(ids.size()));
  scene::drop_warnings(false);  // an error leaves the flag set
  if (failed == 0) return;
  const auto world = std::ranges::find_if(ids, [&](int w) { return *mjb_error(batch, w) != 0; });
  throw ValueError(world == ids.end() ? "MuJoCo cannot use these values"
                                      : fmt::format("MuJoCo cannot use the values of world {}: {}",
                                                    *world, mjb_error(batch, *world)));
}

void step(PySimulation& self, int control_steps) {
  self.change("step", [&](sim::Simulation& sim) { sim.step(control_steps); });
}

void reset(PySimulation& self, const Ids& ids, int key, std::optional<std::uint64_t> seed) {
  self.change("reset", [&](sim::Simulation& sim) {
    const std::vector<int> checked = sim.worlds().checked_ids(worlds_of(ids));
    if (seed) sim.seed(*seed);
    sim.reset(checked, key);
  });
}

// mjlab's call order: MuJoCo's steps first, then the update of every sensor. All sensors are
// updated even if rows of some fail; then the first error is thrown.
void update_sensors(PySimulation& self, double dt) {
  self.change("update", [&](sim::Simulation& sim) {
    sim.update_sensors(dt);
    const std::vector<int> ids = sim.worlds().checked_ids(worlds::all_worlds);
    const double seconds = dt > 0 ? dt : sim.model()->opt.timestep;
    std::exception_ptr fault;
    for (const auto& sensor : self.python()) {
      try {
        sensor->update(ids, seconds);
      } catch (const RowError&) {
        if (!fault) fault = std::current_exception();
      }
    }
    if (fault) std::rethrow_exception(fault);
  });
}

void follow(PySimulation& self, int substeps, const Ids& ids) {
  self.change("update", [&](sim::Simulation& sim) {
    for (const auto& sensor : self.python())
      sensor->set_step_dt(substeps * sim.model()->opt.timestep);
    sim.follow(substeps, worlds_of(ids));
  });
}

void reset_sensors(PySimulation& self, const Ids& ids) {
  self.change("reset_sensors", [&](sim::Simulation& sim) { sim.reset_sensors(worlds_of(ids)); });
}

void forward(PySimulation& self, const Ids& ids) {
  self.change("forward", [&](sim::Simulation& sim) { sim.forward(worlds_of(ids)); });
}

// Rows [B, bytes] of a field of the model. Python gets the data type and shape from MuJoCo's own
// bindings.
NumpyArray model_field(PySimulation& self, const std::string& name) {
  int size = 0, element = 0, worlds = 0;
  void* data = nullptr;
  self.read([&](sim::Simulation& sim) {
    data = mjb_expand(sim.worlds().batch(), name.c_str(), &size, &element);
    worlds = sim.num_worlds();
  });
  if (!data) throw ValueError("mjModel field '" + name + "' cannot have a value per world");
  const std::int64_t bytes = static_cast<std::int64_t>(size) * element;
  return to_numpy(ArrayView::dense(data, DType::kUint8, {worlds, bytes}), self.owner());
}

// Whether the sensor has resolved durations to physics steps when it was initialized.
bool counts_steps(const Sensor& sensor) {
  if (const auto* imu = dynamic_cast<const sensors::ImuSensor*>(&sensor)) return imu->has_errors();
  return dynamic_cast<const effects::EffectSensor*>(&sensor) ||
         ((dynamic_cast<const sensors::RayCastSensor*>(&sensor) ||
           dynamic_cast<const sensors::CameraSensor*>(&sensor)) &&
          sensor.wants_substep());
}

// Sets the duration of a physics step in all worlds, each of which must begin an episode.
void set_timestep(PySimulation& self, double seconds) {
  self.change("options.timestep", [&](sim::Simulation& sim) {
    if (!(seconds > 0 && std::isfinite(seconds)))
      throw ValueError(
          fmt::format("timestep is {}: must be a positive number of seconds", seconds));
    worlds::Worlds& worlds = sim.worlds();
    for (int w = 0; w < sim.num_worlds(); ++w) {
      if (worlds.substeps(w) != 0)
        throw ValueError(fmt::format(
            "timestep: world {} is at {:g} s of its episode, and the timestep can change only at "
            "the beginning of an episode of all worlds: call reset() first",
            w, worlds.time(w)));
    }
    for (const auto& sensor : sim.scene().sensors()) {
      if (counts_steps(*sensor))
        throw ValueError(
            fmt::format("timestep: the noise, delays, ray times or exposures of sensor '{}' are in "
                        "steps of {:g} s: set "
                        "SceneCfg(options=MujocoCfg(timestep={:g})) before the scene is made",
                        sensor->name(), sim.model()->opt.timestep, seconds));
    }
    if (sim.model()->nhistory > 0)
      throw ValueError(
          "timestep: the model has sensors or actuators with a history, whose length is in steps");
    auto* rows = static_cast<mjtNum*>(mjb_expand(worlds.batch(), "opt.timestep", nullptr, nullptr));
    if (!rows) throw RuntimeError("timestep: not enough memory");
    std::fill_n(rows, sim.num_worlds(), seconds);
    // The clocks of the worlds count steps of the batch's own copy of the model.
    const_cast<mjModel*>(mjb_model(worlds.batch()))->opt.timestep = seconds;
    worlds.model_changed();
    for (const auto& sensor : self.python()) sensor->set_step_dt(sim.step_dt());
  });
}

std::string_view kind_name(mjtGeom kind) {
  return kind == mjGEOM_SPHERE ? "sphere" : kind == mjGEOM_LINE ? "line" : "arrow";
}

// (kinds, positions [n, 3], vectors [n, 3], widths [n], rgba [n, 4], labels); float64 except rgba.
nb::tuple draw(PySimulation& self, int world, nb::list handles) {
  std::vector<Sensor*> sensors;
  for (nb::handle h : handles) sensors.push_back(nb::cast<SensorHandle&>(h).sensor.get());
  DebugShapes shapes(0);
  self.read([&](sim::Simulation& sim) { shapes = sim.draw(world, sensors); });
  const auto n = static_cast<std::int64_t>(shapes.list().size());
  const auto array = [](DType dtype, Shape shape) { return std::make_shared<Array>(dtype, shape); };
  const auto positions = array(DType::kFloat64, {n, 3}), vectors = array(DType::kFloat64, {n, 3}),
             widths = array(DType::kFloat64, {n}), rgba = array(DType::kFloat32, {n, 4});
  nb::list kinds, labels;
  for (std::int64_t i = 0; i < n; ++i) {
    const DebugShape& shape = shapes.list()[i];
    kinds.append(kind_name(shape.kind));
    labels.append(shape.label);
    write_vec(shape.pos, positions->all<double>().data() + 3 * i);
    write_vec(shape.vector, vectors->all<double>().data() + 3 * i);
    widths->all<double>()[i] = shape.width;
    std::ranges::copy(shape.rgba, rgba->all<float>().data() + 4 * i);
  }
  const auto numpy = [](const std::shared_ptr<Array>& a) {
    return to_numpy(a->view(), owner_of(a));
  };
  return nb::make_tuple(kinds, numpy(positions), numpy(vectors), numpy(widths), numpy(rgba),
                        labels);
}

}  // namespace

void bind_simulation(nb::module_& m) {
  bind_foreign_arrays(m);
  nb::class_<PySimulation>(m, "Simulation", "The C++ simulation.")
      .def(nb::init<std::shared_ptr<scene::Scene>, int, int, int, std::uint64_t>(),
           nb::arg("scene"), nb::arg("num_worlds"), nb::arg("decimation"), nb::arg("threads"),
           nb::arg("seed"))
      .def("scene", [](const PySimulation& s) { return s.open().scene_ptr(); })
      .def("close", &PySimulation::close)
      .def_prop_ro("closed", &PySimulation::closed)
      .def_prop_ro("num_worlds", [](const PySimulation& s) { return s.open().num_worlds(); })
      .def_prop_ro("decimation", [](const PySimulation& s) { return s.open().decimation(); })
      .def_prop_ro("threads", [](const PySimulation& s) { return s.open().worlds().threads(); })
      .def_prop_ro("step_dt", [](const PySimulation& s) { return s.open().step_dt(); })
      .def_prop_ro("physics_dt",
                   [](const PySimulation& s) { return s.open().model()->opt.timestep; })
      .def_prop_ro("meansize",
                   [](const PySimulation& s) { return s.open().model()->stat.meansize; })
      .def_prop_ro("seed", [](const PySimulation& s) { return s.open().worlds().seed(); })
      .def("step", &step, nb::arg("control_steps") = 1)
      .def("reset", &reset, nb::arg("world_ids") = nb::none(), nb::arg("key") = -1,
           nb::arg("seed") = nb::none())
      .def("follow", &follow, nb::arg("substeps"), nb::arg("world_ids"))
      .def("reset_sensors", &reset_sensors, nb::arg("world_ids") = nb::none())
      .def("forward", &forward, nb::arg("world_ids") = nb::none())
      .def(
          "step_raw",
          [](PySimulation& s, int n) {
            s.change("step_raw", [&](sim::Simulation& sim) { sim.step_raw(n); });
          },
          nb::arg("substeps"))
      .def("update_sensors", &update_sensors, nb::arg("dt") = 0.0)
      .def(
          "refresh",
          [](PySimulation& s, const SensorHandle& h) {
            s.read([&](sim::Simulation& sim) { sim.refresh(*h.sensor); });
          },
          nb::arg("sensor"))
      .def(
          "refresh_all",
          [](PySimulation& s, nb::list handles) {
            std::vector<Sensor*> sensors;
            for (nb::handle h : handles) sensors.push_back(nb::cast<SensorHandle&>(h).sensor.get());
            s.read([&](sim::Simulation& sim) { sim.refresh(sensors); });
          },
          nb::arg("sensors"))
      .def("draw", &draw, nb::arg("world"), nb::arg("sensors"))
      .def(
          "invalidate",
          [](PySimulation& s, const Ids& ids) {
            s.change("invalidate", [&](sim::Simulation& sim) { sim.invalidate(worlds_of(ids)); });
          },
          nb::arg("world_ids") = nb::none())
      .def(
          "add_sensor",
          [](PySimulation& s, nb::object object) {
            auto sensor =
                std::make_shared<PythonSensor>(nb::cast<std::string>(object.attr("uuid")),
                                               WeakObject(object), read_python_spec(object));
            s.change("add", [&](sim::Simulation& sim) {
              sim.add(sensor);
              s.add_python(sensor);
            });
            return SensorHandle{sensor};
          },
          nb::arg("sensor"), "Adds a mjsense.Sensor that is not part of the scene.")
      .def(
          "add_native",
          [](PySimulation& s, const SensorHandle& h) {
            s.change("add", [&](sim::Simulation& sim) { sim.add(h.sensor); });
          },
          nb::arg("sensor"), "Adds a C++ sensor that is not part of the scene.")
      .def(
          "data_copies",
          [](PySimulation& s, nb::list datas) {
            auto sensor = make_data_copies(datas);
            s.read([&](sim::Simulation& sim) { sim.add(sensor); });
            return SensorHandle{sensor};
          },
          nb::arg("datas"), "mujoco.MjData objects that show the worlds when this is refreshed.")
      .def(
          "own_sensor",
          [](PySimulation& s, const SensorHandle& h) {
            if (auto sensor = std::dynamic_pointer_cast<PythonSensor>(h.sensor))
              s.read([&](sim::Simulation&) { s.add_python(sensor); });
          },
          nb::arg("sensor"), "Tells a Python sensor of the scene about resets from now on.")
      .def(
          "component",
          [](PySimulation& s, const std::string& name) {
            return to_numpy(s.open().worlds().state_component(name), s.owner());
          },
          nb::arg("name"))
      .def("state", [](PySimulation& s) { return to_numpy(s.open().worlds().state(), s.owner()); })
      .def("model_field", &model_field, nb::arg("name"))
      .def("set_timestep", &set_timestep, nb::arg("seconds"))
      .def(
          "derived_field",
          [](PySimulation& s, const std::string& name) {
            auto sensor = make_derived_field(name, s.open().model());
            s.read([&](sim::Simulation& sim) { sim.add(sensor); });
            return SensorHandle{sensor};
          },
          nb::arg("name"), "A field of mjData as a sensor.")
      .def(
          "derived_fields", [](PySimulation& s) { return derived_field_names(s.open().model()); },
          "What derived_field() takes.")
      .def(
          "model_changed",
          [](PySimulation& s, const Ids& ids, bool set_const) {
            s.change("randomize", [&](sim::Simulation& sim) {
              const std::vector<int> checked = sim.worlds().checked_ids(worlds_of(ids));
              if (checked.empty()) return;  // MuJoCo would interpret an empty list as all worlds
              for (const int w : checked) check_element_indices(sim.model_of(w));
              if (set_const) set_constants(sim.worlds().batch(), checked);
              sim.worlds().model_changed();
            });
          },
          nb::arg("world_ids"), nb::arg("set_const"))
      .def(
          "options_changed",
          [](PySimulation& s) {
            bool nested = false;
            s.read([&](sim::Simulation& sim) {
              sim.worlds().model_changed();
              nested = s.nested();
            });
            return !nested;
          },
          "Call after rows of mjOption were written. False if the simulation is running: the "
          "values then take effect "
          "at the next step.")
      .def(
          "copy_model",
          [](PySimulation& s) {
            std::uintptr_t copy = 0;
            s.read([&](sim::Simulation& sim) {
              copy = reinterpret_cast<std::uintptr_t>(mj_copyModel(nullptr, sim.model()));
            });
            return copy;
          },
          "Address of a copy of the model that is simulated, which the caller owns.")
      .def(
          "write_model",
          [](PySimulation& s, int world, std::uintptr_t address) {
            s.read([&](sim::Simulation& sim) {
              sim.worlds().write_model(world, reinterpret_cast<mjModel*>(address));
            });
          },
          nb::arg("world"), nb::arg("address"), "Writes a world's own values into such a copy.")
      .def("model_version",
           [](PySimulation& s) {
             std::int64_t version = 0;
             s.read([&](sim::Simulation& sim) { version = sim.worlds().model_version(); });
             return version;
           })
      .def(
          "warning_counts",
          [](PySimulation& s) {
            std::vector<std::vector<std::int64_t>> counts(mjNWARNING);
            s.read([&](sim::Simulation& sim) {
              for (int i = 0; i < mjNWARNING; ++i) {
                for (int w = 0; w < sim.num_worlds(); ++w)
                  counts[i].push_back(sim.worlds().warning_counts(w)[i]);
              }
            });
            return counts;
          },
          "By mjtWarning and world.")
      .def("times",
           [](PySimulation& s) {
             std::vector<double> times;
             s.read([&](sim::Simulation& sim) {
               for (int w = 0; w < sim.num_worlds(); ++w) times.push_back(sim.worlds().time(w));
             });
             return times;
           })
      .def("failures", [](PySimulation& s) {
        std::vector<worlds::Failure> now;
        s.read([&](sim::Simulation& sim) { now = sim.failures(); });
        nb::list failures;
        for (const worlds::Failure& f : now) failures.append(nb::make_tuple(f.world, f.message));
        return failures;
      });
}

}  // namespace mjsense::python
