// SPDX-License-Identifier: Apache-2.0
#pragma once
// Values of TOML files as values of fields: what every reader of such files shares.

#if __has_include(<toml++/impl/preprocessor.h>)
#include <toml++/impl/preprocessor.h>  // 3.3
#else
#include <toml++/impl/preprocessor.hpp>  // 3.4: Ubuntu 24.04, Debian 13
#endif
// toml++ 3.3 asserts of a file what a file may break ("[+a]"), or lets clang assume it; its code answers
// rightly where neither is done.
#undef TOML_ASSERT_ASSUME
#define TOML_ASSERT_ASSUME(expr) static_assert(true)
#include <toml++/toml.h>

#include <string>
#include <string_view>

#include "mjsense/core/fields.h"

namespace mjsense {

// ValueError "x.toml:3: ..." where the text is no TOML. `path` is what messages say.
toml::table parse_toml(std::string_view text, const std::string& path);

// "x.toml:3": where a node stands.
std::string toml_place(const std::string& path, const toml::node& node);

// As read_toml_fields() of a whole file (core/toml_fields.h), of one table; `inside` is what messages
// call it: "sensors[1]", "" at the top.
void read_toml_table(const toml::table& table, const std::string& path, const StructDecl& decl,
                     void* object, const std::string& inside);

// A bool, number, text, path or word, or lists, arrays and optionals of them. False if the value is
// of another type, or does not fit. ValueError, beginning with `place`, for a word that there is not.
bool read_toml_value(const FieldType& type, void* out, const toml::node& node,
                     std::string_view place, std::string_view name);

}  // namespace mjsense
