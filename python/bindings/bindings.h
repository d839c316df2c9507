// SPDX-License-Identifier: Apache-2.0
#pragma once
// Binding functions of the extension. Each is defined in the file of the same name.

#include <nanobind/nanobind.h>

namespace mjsense::python {

void bind_libmujoco(nanobind::module_& m);
void bind_mujoco_views(nanobind::module_& m);
void bind_spec_views(nanobind::module_& m);
void bind_cameras(nanobind::module_& m);
void bind_core(nanobind::module_& m);
void bind_scene(nanobind::module_& m);
void bind_simulation(nanobind::module_& m);
void bind_contact(nanobind::module_& m);
void bind_effects(nanobind::module_& m);
void bind_raycast(nanobind::module_& m);
void bind_renderer(nanobind::module_& m);
void bind_recorder(nanobind::module_& m);
void bind_robot(nanobind::module_& m);
void bind_rollout(nanobind::module_& m);
void bind_program(nanobind::module_& m);
void bind_listing(nanobind::module_& m);
void bind_measured_scenes(nanobind::module_& m);
void bind_core_sensors(nanobind::module_& m);
void bind_task_view(nanobind::module_& m);

}  // namespace mjsense::python
