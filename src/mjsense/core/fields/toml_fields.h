// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads a struct with fields (core/fields/fields.h) from a TOML file. Keys are the names of its fields,
// objects are tables, lists of objects are arrays of tables, and choices are tables with a `kind`.

#include <string>
#include <string_view>

#include "mjsense/core/fields/fields.h"

namespace mjsense {

// Sets the fields that the text contains; other fields keep their values. Errors name file, line
// and key: "robot.toml:12: no key of 'groups[1]' named 'jonts'; did you mean 'joints'?". `path` is
// the file's name in error messages.
void read_toml_fields(std::string_view text, const std::string& path, const StructDecl& decl,
                      void* object);

template <Described T>
void read_toml_fields(std::string_view text, const std::string& path, T& object) {
  read_toml_fields(text, path, struct_of<T>(), &object);
}

}  // namespace mjsense
