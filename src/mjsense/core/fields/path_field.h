// SPDX-License-Identifier: Apache-2.0
#pragma once
// Paths as fields. In a header of its own, because including <filesystem> would add a fifth to the
// compile time of every configuration.

#include <filesystem>

#include "mjsense/core/fields/field_traits.h"

namespace mjsense {

template <>
struct CustomFieldType<std::filesystem::path> {
  static FieldType make();
};

}  // namespace mjsense
