// SPDX-License-Identifier: Apache-2.0
#pragma once
// Paths as fields. In a header of its own, because including <filesystem> would add a fifth to the
// compile time of fields.h.

#include <filesystem>

#include "mjsense/core/fields.h"

namespace mjsense {

template <>
struct CustomFieldType<std::filesystem::path> {
  static FieldType make();
};

}  // namespace mjsense
