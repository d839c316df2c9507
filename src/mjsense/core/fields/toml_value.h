// SPDX-License-Identifier: Apache-2.0
#pragma once
// Conversion of TOML values to values of fields, shared by all readers of TOML files.

#if __has_include(<toml++/impl/preprocessor.h>)
#include <toml++/impl/preprocessor.h>  // 3.3
#else
#include <toml++/impl/preprocessor.hpp>  // 3.4: Ubuntu 24.04, Debian 13
#endif
// toml++ 3.3 asserts conditions that an input file can violate ("[+a]"), or lets clang assume them.
// Its code handles such input correctly if both are disabled.
#undef TOML_ASSERT_ASSUME
#define TOML_ASSERT_ASSUME(expr) static_assert(true)
#include <toml++/toml.h>

#include <string>
#include <string_view>

#include "mjsense/core/fields/fields.h"

namespace mjsense {

// Throws ValueError "x.toml:3: ..." if the text is not valid TOML. `path` is used in messages.
toml::table parse_toml(std::string_view text, const std::string& path);

// Location of a node: "x.toml:3".
std::string toml_context(const std::string& path, const toml::node& node);

// Like read_toml_fields() (core/fields/toml_fields.h), for one table. `inside` is the name of the table in
// messages, "sensors[1]"; "" for the top level.
void read_toml_table(const toml::table& table, const std::string& path, const StructDecl& decl,
                     void* object, const std::string& inside);

// Reads a bool, number, text, path or word, or lists, arrays and optionals of them. Returns false
// if the value has another type or does not fit. Throws ValueError, prefixed with `context`, for an
// unknown word.
bool read_toml_value(const FieldType& type, void* out, const toml::node& node,
                     std::string_view context, std::string_view name);

}  // namespace mjsense
