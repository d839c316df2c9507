// SPDX-License-Identifier: Apache-2.0
#pragma once
// Everything that can be configured and everything that sensors return, as JSON: what generators of
// code and documentation read (tools/generate.py).

#include <string>
#include <string_view>

#include "mjsense/core/fields.h"

namespace mjsense {

std::string schema_json();
// By its name in Python; null if there is none.
const StructDecl* find_struct(std::string_view name);

}  // namespace mjsense
