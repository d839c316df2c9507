// SPDX-License-Identifier: Apache-2.0
#pragma once
// Paths as fields: apart, because <filesystem> is a fifth of what fields.h costs every file.

#include <filesystem>

#include "mjsense/core/fields.h"

namespace mjsense {

template <>
struct CustomFieldType<std::filesystem::path> {
  static FieldType make();
};

}  // namespace mjsense
