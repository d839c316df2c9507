// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/rollout_host.h"

#include <nanobind/stl/string.h>

#include "python/bindings/scene.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {

void PythonHost::add_note(nb::python_error& error, const std::string& context) {
  nb::object value = nb::borrow(error.value());
  value.attr("add_note")("in " + context);
}

scene::SceneCfg PythonHost::read_prepared(nb::object prepared) {
  nb::list alive;
  scene::SceneCfg cfg =
      read_scene(prepared[0], prepared[1], nb::cast<nb::list>(prepared[2]), prepared[3], alive);
  alive.append(prepared);
  scene_ = PyHandle(nb::object(prepared[4]));
  alive_ = PyHandle(std::move(alive));
  return cfg;
}

nb::object PythonHost::simulation(const std::shared_ptr<sim::Simulation>& sim) {
  if (!simulation_) {
    core_ = new PySimulation(sim, sim_lock_);
    nb::object core = nb::cast(core_, nb::rv_policy::take_ownership);
    nb::object view = nb::cast(TaskView(cell_, sim_lock_));
    simulation_ = PyHandle(make_.get()(core, scene_ ? scene_.get() : nb::none(), view));
  }
  return nb::borrow(simulation_.get());
}

std::vector<std::shared_ptr<Sensor>> PythonHost::members(
    nb::handle sensors, const std::shared_ptr<sim::Simulation>& sim) {
  nb::object shown = simulation(sim);
  nb::object prepared =
      nb::module_::import_("mjsense.tasks.members").attr("prepare")(shown, sensors);
  std::vector<std::shared_ptr<Sensor>> made;
  for (nb::handle object : prepared) {
    if (nb::isinstance<SensorHandle>(object)) {
      made.push_back(nb::cast<SensorHandle&>(object).sensor);
      continue;
    }
    auto sensor = std::make_shared<PythonSensor>(nb::cast<std::string>(object.attr("uuid")),
                                                 WeakObject(object), read_python_spec(object));
    // Weak, because the simulation owns the sensor and a reference cycle would never be freed.
    sensor->on_initialized = [weak = std::weak_ptr<PythonSensor>(sensor), host = weak_from_this()] {
      auto self = weak.lock();
      self->self().attr("_mjs_bind")(host.lock()->simulation_.get(), SensorHandle{self});
    };
    core_->add_python(sensor);
    made.push_back(sensor);
  }
  return made;
}

void PythonHost::close() {
  end();
  if (simulation_) nb::borrow(simulation_.get()).attr("close")();
}

}  // namespace mjsense::python
