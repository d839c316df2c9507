// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads Python objects into C++ configurations, based on their field declarations.

#include <nanobind/nanobind.h>

#include <memory>
#include <string>

#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"

namespace mjsense::python {

namespace nb = nanobind;

// Throws TypeError for a missing attribute or a value of the wrong type, "ContactSensorCfg 'feet':
// num_slots must be an int, not 'two'"; ValueError for an unknown word.
void read_struct(nb::handle config, const StructDecl& decl, void* out);
template <Described T>
void read_struct(nb::handle config, T& out) {
  read_struct(config, struct_of<T>(), &out);
}
// Reads only the given entries of a dict whose keys are names of fields or of their options.
void read_options(nb::dict options, const StructDecl& decl, void* out);
// Reads one value as if it were the attribute `field` of `config`.
void read_value(nb::handle config, const FieldDecl& field, nb::handle value, void* out);

// Throws TypeError or ValueError if the configuration is invalid.
void check_cfg(nb::handle config);
// Throws TypeError if `config` is not a sensor configuration.
std::shared_ptr<SensorCfg> read_sensor_cfg(nb::handle config);

// Converts a mapping or a sequence of pairs; throws TypeError for other objects.
nb::dict dict_of(nb::handle mapping);

}  // namespace mjsense::python
