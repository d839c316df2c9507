// SPDX-License-Identifier: Apache-2.0
#pragma once
// A TOML file that says what a struct with fields is: keys are the names of its fields, objects are
// tables, lists of objects arrays of tables, choices tables whose `kind` says which.

#include <string>
#include <string_view>

#include "mjsense/core/fields.h"

namespace mjsense {

// Sets what the text says; what it does not say stays. Errors name file, line and key:
// "robot.toml:12: no key of 'groups[1]' named 'jonts'; did you mean 'joints'?". `path` is what they
// call the file.
void read_toml_fields(std::string_view text, const std::string& path, const StructDecl& decl,
                      void* object);

template <Described T>
void read_toml_fields(std::string_view text, const std::string& path, T& object) {
  read_toml_fields(text, path, struct_of<T>(), &object);
}

}  // namespace mjsense
