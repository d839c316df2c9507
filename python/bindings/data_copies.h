// SPDX-License-Identifier: Apache-2.0
#pragma once
// Copies of the worlds in mujoco.MjData objects of Python.

#include <nanobind/nanobind.h>

#include <memory>

#include "mjsense/core/sensor.h"

namespace mjsense::python {

// Sensor that copies world w into datas[w] when it is read and out of date. It keeps the list
// alive, whose objects must belong to the simulation's model. Requires the GIL.
std::shared_ptr<Sensor> make_data_copies(nanobind::list datas);

}  // namespace mjsense::python
