// SPDX-License-Identifier: Apache-2.0
// The extension module mjsense._core. Users access it through the package mjsense.

#include <nanobind/nanobind.h>

#include "python/bindings/bindings.h"

NB_MODULE(_core, m) {
  m.doc() = "The C++ side of mjsense.";
  // The order of destruction at interpreter exit is arbitrary, so leak reports would be meaningless
  // to users.
  nanobind::set_leak_warnings(false);
  mjsense::python::bind_libmujoco(m);
  mjsense::python::bind_mujoco_views(m);
  mjsense::python::bind_spec_views(m);
  mjsense::python::bind_core(m);
  mjsense::python::bind_scene(m);
  mjsense::python::bind_simulation(m);
  mjsense::python::bind_contact(m);
  mjsense::python::bind_effects(m);
  mjsense::python::bind_raycast(m);
  mjsense::python::bind_renderer(m);
  mjsense::python::bind_recorder(m);
  mjsense::python::bind_robot(m);
  mjsense::python::bind_cameras(m);
  mjsense::python::bind_core_sensors(m);
  mjsense::python::bind_task_view(m);
  mjsense::python::bind_rollout(m);
  mjsense::python::bind_program(m);
  mjsense::python::bind_listing(m);
  mjsense::python::bind_measured_scenes(m);
}
