// SPDX-License-Identifier: Apache-2.0
#pragma once
// Fields as options of the program and keys of an experiment file.

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>

#include "mjsense/core/fields.h"

namespace mjsense {

// An option for every field that is not hidden and can be written as one text: --name VALUE, --name
// for what is false by default, --no-name for what is true. `skip`: names that the command has as
// arguments of its own, or that mean nothing to it.
void add_field_options(CLI::App& app, const StructDecl& decl, void* object,
                       std::initializer_list<std::string_view> skip);
// --size WxH, and --set name=value for every field.
void add_set_options(CLI::App& app, const StructDecl& decl, void* object);

// "640x368" -> the fields width and height. ValueError.
void read_size(const StructDecl& decl, void* object, std::string_view text);

// A TOML file whose keys are the options, with '_' for '-'. ValueError "x.toml:3: no key named
// 'episods'; did you mean 'episodes'?"
void read_toml(const std::string& path, const StructDecl& decl, void* object);
// The same of its text; `path` is its name in errors.
void read_toml_text(std::string_view text, const std::string& path, const StructDecl& decl,
                    void* object);

}  // namespace mjsense
