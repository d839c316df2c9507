// SPDX-License-Identifier: Apache-2.0
#pragma once
// All configurations and all sensor outputs as JSON, for the generators of code and documentation
// (tools/generate.py).

#include <string>
#include <string_view>

#include "mjsense/core/fields/fields.h"

namespace mjsense::python {

std::string schema_json();
// Finds a struct by its name in Python; null if there is none.
const StructDecl* find_struct(std::string_view name);

}  // namespace mjsense::python
