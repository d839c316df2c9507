// SPDX-License-Identifier: Apache-2.0
#pragma once
// A field of mjData as a sensor, so that sim.data.xpos in Python is fresh, lazily computed and
// cached like any measurement.

#include <nanobind/nanobind.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::python {

// Rows in MuJoCo's data type, [B, *]; 3 x 3 matrices are [9]. Throws KeyError unless `name` is a
// field with one row per world.
std::shared_ptr<Sensor> make_derived_field(std::string_view name, const mjModel* model);

// Valid field names, in MuJoCo's order.
std::vector<std::string> derived_field_names(const mjModel* model);

}  // namespace mjsense::python
