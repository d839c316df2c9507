// SPDX-License-Identifier: Apache-2.0
#pragma once
// Fields as options of the program and keys of an experiment file.

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>

#include "mjsense/app/completion.h"
#include "mjsense/core/fields/fields.h"

namespace mjsense::app {

// Adds an option for every field that is not hidden and can be written as one text: --name VALUE;
// for booleans --name if the default is false, --no-name if it is true. `skip`: names of fields
// that are arguments of the command or do not apply to it.
void add_field_options(CLI::App& app, const StructDecl& decl, void* object,
                       std::initializer_list<std::string_view> skip);
// Adds the words that fields accept to `choices`.
void add_choices(const StructDecl& decl, Choices& choices);
// --size WxH, and --set name=value for every field.
void add_set_options(CLI::App& app, const StructDecl& decl, void* object);

// Parses "640x368" into the fields width and height. Throws ValueError.
void read_size(const StructDecl& decl, void* object, std::string_view text);

// Reads a TOML file whose keys are the option names, with '_' for '-'. Throws ValueError "x.toml:3:
// no key named 'episods'; did you mean 'episodes'?"
void read_toml(const std::string& path, const StructDecl& decl, void* object);
// Like read_toml(), for the text of a file; `path` is its name in error messages.
void read_toml_text(std::string_view text, const std::string& path, const StructDecl& decl,
                    void* object);

}  // namespace mjsense::app
