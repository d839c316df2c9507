// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads Python objects into C++ configurations, by the table of their fields.

#include <nanobind/nanobind.h>

#include <string>

#include "mjsense/core/sensor_fields.h"

namespace mjsense::python {

namespace nb = nanobind;

// TypeError for a missing attribute or a value of another type, "ContactSensorCfg 'feet': num_slots
// must be an int, not 'two'"; ValueError for an unknown word.
void read_struct(nb::handle config, const StructDecl& decl, void* out);
template <Described T>
void read_struct(nb::handle config, T& out) {
  read_struct(config, struct_of<T>(), &out);
}
// Only what is given: a dict whose keys are names of fields or of their options.
void read_options(nb::dict options, const StructDecl& decl, void* out);
// One value, as the attribute `field` of `config`.
void read_value(nb::handle config, const FieldDecl& field, nb::handle value, void* out);

// Raises what is wrong with a configuration: TypeError or ValueError.
void check_cfg(nb::handle config);
// Throws TypeError for an object that is no sensor configuration.
std::shared_ptr<SensorCfg> read_sensor_cfg(nb::handle config);

// Any mapping, or pairs; TypeError for what is neither.
nb::dict dict_of(nb::handle mapping);

}  // namespace mjsense::python
