// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/python_sensor.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "mjsense/core/error.h"

namespace mjsense::python {
namespace {

// Deletes a reference to a Python object from any thread. After the interpreter has ended, the
// reference is leaked.
template <class T>
void give_back(T* reference) {
  if (!nb::is_alive()) return;
  nb::gil_scoped_acquire lock;
  delete reference;
}

nb::list list_of(std::span<const int> ids) {
  nb::list list;
  for (int w : ids) list.append(w);
  return list;
}

// `faults`: [(world, exception)] as returned by a mjsense.Sensor.
void throw_faults(nb::handle faults) {
  if (nb::len(faults) == 0) return;
  std::vector<RowError::Fault> all;
  PyHandle first;
  for (nb::handle fault : faults) {
    nb::object exception = fault[1];
    if (all.empty()) first = PyHandle(exception);
    all.push_back({nb::cast<int>(fault[0]), nb::cast<std::string>(nb::str(exception))});
  }
  throw PythonRowError(std::move(all), std::move(first));
}

}  // namespace

WeakObject::WeakObject(nb::handle object)
    : reference_(new nb::weakref(object), give_back<nb::weakref>) {}

nb::object WeakObject::get() const {
  nb::object object = (*reference_)();
  if (object.is_none())
    throw RuntimeError("a sensor written in Python was deleted while its simulation uses it");
  return object;
}

PyHandle::PyHandle(nb::object object)
    : object_(new nb::object(std::move(object)), give_back<nb::object>) {}

void PythonSensor::edit_spec(mjSpec*) {
  nb::gil_scoped_acquire lock;
  self().attr("_mjs_edit_spec")();
}

void PythonSensor::initialize(const SensorInit& init) {
  clear_fields();
  for (const auto& [name, spec] : spec_.fields) add_field(name, spec, init.num_worlds);
  step_dt_ = init.decimation * init.model->opt.timestep;
  seeds_.assign(init.num_worlds, 0);
  begun_.assign(init.num_worlds, 0);
  updates_.assign(init.num_worlds, 0);
  reset_.assign(init.num_worlds, 0);
  if (on_initialized) {
    nb::gil_scoped_acquire lock;
    std::exchange(on_initialized, nullptr)();
  }
}

void PythonSensor::cast(const CastContext& context) {
  nb::gil_scoped_acquire lock;
  flush_resets();
  throw_faults(self().attr("_mjs_compute_rows")(list_of(context.ids), seeds_of(context.ids)));
}

// The random numbers depend on the number of updates since the reset, not on reads in between.
void PythonSensor::update(std::span<const int> ids, double dt) {
  if (!spec_.updates) return;
  nb::gil_scoped_acquire lock;
  flush_resets();
  nb::list seeds;
  for (int w : ids) seeds.append(Rng(begun_[w], 0, stream_of(name()), ++updates_[w]).next());
  throw_faults(self().attr("_mjs_control_step")(list_of(ids), dt, seeds));
}

// The seed depends on the episode and its time, not on the world.
void PythonSensor::draw_seed(const World& world) {
  seeds_[world.id] = world.rng(stream_of(name())).next();
}

nb::list PythonSensor::seeds_of(std::span<const int> ids) const {
  nb::list list;
  for (int w : ids) list.append(seeds_[w]);
  return list;
}

void PythonSensor::reset(const World& world) {
  draw_seed(world);
  begun_[world.id] = seeds_[world.id];
  updates_[world.id] = 0;
  reset_[world.id] = 1;
  any_reset_ = true;
}

void PythonSensor::tell_resets() {
  if (!any_reset_) return;
  nb::gil_scoped_acquire lock;
  flush_resets();
}

void PythonSensor::flush_resets() {
  if (!any_reset_.exchange(false)) return;
  std::vector<int> ids;
  for (std::size_t w = 0; w < reset_.size(); ++w) {
    if (reset_[w]) ids.push_back(static_cast<int>(w));
    reset_[w] = 0;
  }
  self().attr("_mjs_reset")(list_of(ids), seeds_of(ids));
}

SensorSpec read_row_spec(nb::handle field) {
  SensorSpec spec;
  spec.dtype = dtype_from_name(nb::cast<std::string>(field["dtype"]));
  spec.shape =
      Shape(std::span<const std::int64_t>(nb::cast<std::vector<std::int64_t>>(field["shape"])));
  spec.unit = nb::cast<std::string>(field["unit"]);
  spec.frame = nb::cast<std::string>(field["frame"]);
  spec.low = nb::cast<double>(field["low"]);
  spec.high = nb::cast<double>(field["high"]);
  spec.is_dict = nb::cast<bool>(field["is_dict"]);
  if (spec.is_dict) spec.str_max_len = static_cast<int>(spec.shape[0]);
  spec.description = nb::cast<std::string>(field["description"]);
  if (nb::cast<bool>(nb::handle(field).attr("get")("video", false))) {
    spec.storage = spec.dtype == DType::kUint8 ? Storage::kRgbVideo : Storage::kDepthVideo;
  }
  return spec;
}

PythonSensorSpec read_python_spec(nb::handle sensor) {
  PythonSensorSpec declared;
  declared.updates = nb::cast<bool>(sensor.attr("_mjs_updates")());
  for (nb::handle field : nb::object(sensor.attr("_mjs_row_specs")()))
    declared.fields.emplace_back(nb::cast<std::string>(field["name"]), read_row_spec(field));
  return declared;
}

}  // namespace mjsense::python
