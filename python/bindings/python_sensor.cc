// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/python_sensor.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "mjsense/core/error.h"

namespace mjsense::python {

WeakObject::WeakObject(nb::handle object)
    : reference_(new nb::weakref(object), [](nb::weakref* reference) {
        // What outlives the interpreter has nobody left to give it back to.
        if (!nb::is_alive()) return;
        nb::gil_scoped_acquire lock;
        delete reference;
      }) {}

nb::object WeakObject::get() const {
  nb::object object = (*reference_)();
  if (object.is_none())
    throw RuntimeError("a sensor written in Python was deleted while its simulation uses it");
  return object;
}

void PythonSensor::edit_spec(mjSpec*) {
  nb::gil_scoped_acquire lock;
  self().attr("_mjs_edit_spec")();
}

void PythonSensor::initialize(const SensorInit& init) {
  clear_fields();
  if (spec_) add_field("", *spec_, init.num_worlds);
  reset_.assign(init.num_worlds, 0);
  if (on_initialized) {
    nb::gil_scoped_acquire lock;
    on_initialized();
  }
}

void PythonSensor::cast(const CastContext&) {
  nb::gil_scoped_acquire lock;
  flush_resets();
  self().attr("_mjs_compute_rows")();
}

void PythonSensor::reset(const World& world) {
  reset_[world.id] = 1;
  any_reset_ = true;
}

void PythonSensor::flush_resets() {
  if (!any_reset_.exchange(false)) return;
  nb::list ids;
  for (std::size_t w = 0; w < reset_.size(); ++w) {
    if (reset_[w]) ids.append(w);
    reset_[w] = 0;
  }
  self().attr("_mjs_reset")(ids);
}

std::optional<SensorSpec> read_python_spec(nb::handle sensor) {
  nb::object declared = sensor.attr("_mjs_row_spec")();
  if (declared.is_none()) return {};
  SensorSpec spec;
  spec.dtype = dtype_from_name(nb::cast<std::string>(declared["dtype"]));
  spec.shape =
      Shape(std::span<const std::int64_t>(nb::cast<std::vector<std::int64_t>>(declared["shape"])));
  spec.unit = nb::cast<std::string>(declared["unit"]);
  spec.frame = nb::cast<std::string>(declared["frame"]);
  spec.low = nb::cast<double>(declared["low"]);
  spec.high = nb::cast<double>(declared["high"]);
  spec.is_dict = nb::cast<bool>(declared["is_dict"]);
  if (spec.is_dict) spec.str_max_len = static_cast<int>(spec.shape[0]);
  spec.description = nb::cast<std::string>(declared["description"]);
  return spec;
}

}  // namespace mjsense::python
