// SPDX-License-Identifier: Apache-2.0
#pragma once
// A field of mjData as a sensor: sim.data.xpos in Python is fresh, lazy and cached in the same way
// as any measurement.

#include <nanobind/nanobind.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense::python {

// Rows of MuJoCo's own type, [B, *]; 3 x 3 matrices as [9]. Throws KeyError for a name that is no
// field with a row per world.
std::shared_ptr<Sensor> make_derived_field(std::string_view name, const mjModel* model);

// What it takes, in MuJoCo's order.
std::vector<std::string> derived_field_names(const mjModel* model);

}  // namespace mjsense::python
