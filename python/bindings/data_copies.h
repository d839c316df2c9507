// SPDX-License-Identifier: Apache-2.0
#pragma once
// mujoco.MjData objects of Python that show the worlds as they are.

#include <nanobind/nanobind.h>

#include <memory>

#include "mjsense/core/sensor.h"

namespace mjsense::python {

// Copies world w into datas[w] when it is read and not current. It keeps the list alive, whose
// objects must be of the simulation's model. Needs the interpreter's lock.
std::shared_ptr<Sensor> make_data_copies(nanobind::list datas);

}  // namespace mjsense::python
