// SPDX-License-Identifier: Apache-2.0
#include "mjsense/app/field_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"

namespace mjsense::app {
namespace {

using Kind = FieldType::Kind;

bool is_flag(const FieldDecl& field) { return field.type->kind == Kind::kBool; }

bool has_text(const FieldType& type) {
  switch (type.kind) {
    case Kind::kMap:
    case Kind::kObject:
    case Kind::kChoice:
      return false;
    case Kind::kOptional:
      return has_text(type.element());
    case Kind::kArray:
    case Kind::kList:  // of elements whose text contains no commas
      return has_text(type.element()) && !type.element().element;
    default:
      return true;
  }
}

bool flag_default(const StructDecl& decl, const FieldDecl& field) {
  return *static_cast<const bool*>(at(decl.defaults.get(), field));
}

std::string dashed(std::string name) {
  std::ranges::replace(name, '_', '-');
  return name;
}

const char* type_name(const FieldType& type) {
  switch (type.kind) {
    case Kind::kOptional:
      return type_name(type.element());
    case Kind::kInt:
    case Kind::kUnsigned:
      return "INT";
    case Kind::kNumber:
      return "FLOAT";
    case Kind::kPath:
      return "DIR";
    case Kind::kList:
      return "NAMES";
    default:
      return "TEXT";
  }
}

std::string help(const FieldDecl& field) {
  std::string text = field.sentence;
  std::erase(text, '`');
  if (*field.unit_) text += fmt::format(" [{}]", field.unit_);
  return text;
}

// "Draw shadows." -> "Do not draw shadows."
std::string negated_help(const FieldDecl& field) {
  std::string text = help(field);
  text[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(text[0])));
  return "Do not " + text;
}

// The words that a field accepts; empty if it accepts anything of its type.
std::span<const std::string_view> words_of(const FieldDecl& field) {
  if (!field.words.empty()) return field.words;
  const FieldType* type = field.type;
  while (type->kind == Kind::kOptional || type->kind == Kind::kList) type = &type->element();
  return type->words;
}

// "auto|shapes|real" if it is short, else the name of the type.
std::string value_name(const FieldDecl& field) {
  constexpr std::size_t kMaxWidth = 24;
  const std::string words = fmt::format("{}", fmt::join(words_of(field), "|"));
  return words.empty() || words.size() > kMaxWidth ? type_name(*field.type) : words;
}

void set_field(const StructDecl& decl, void* object, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  if (equals == std::string::npos)
    throw ValueError(fmt::format("--set {}: expected NAME=VALUE", assignment));
  std::string name = assignment.substr(0, equals);
  std::ranges::replace(name, '-', '_');
  std::vector<std::string> names;
  for (const FieldDecl& field : decl.fields) {
    if (name == field.option_name() || name == field.name)
      return read_text(field, object, std::string_view(assignment).substr(equals + 1));
    names.emplace_back(field.option_name());
  }
  throw_unknown("--set", "field", name, names);
}

}  // namespace

void add_field_options(CLI::App& app, const StructDecl& decl, void* object,
                       std::initializer_list<std::string_view> skip) {
  for (const FieldDecl& field : decl.fields) {
    const std::string name = dashed(field.flag_name());
    if (field.is_hidden || !field.type || !has_text(*field.type)) continue;
    if (std::ranges::find(skip, name) != skip.end()) continue;
    if (is_flag(field)) {
      bool& value = *static_cast<bool*>(at(object, field));
      if (flag_default(decl, field)) {
        app.add_flag_callback(
            "--no-" + name, [&value] { value = false; }, negated_help(field));
      } else {
        app.add_flag("--" + name, value, help(field));
      }
      continue;
    }
    app.add_option_function<std::string>(
           "--" + name,
           [&field, object](const std::string& text) {
             try {
               read_text(field, object, text);
             } catch (const ValueError& e) {
               throw ValueError(std::string("--") + e.what());
             }
           },
           help(field))
        ->type_name(value_name(field))
        ->default_str(write_text(field, object));
  }
}

void add_choices(const StructDecl& decl, Choices& choices) {
  for (const FieldDecl& field : decl.fields) {
    if (field.type && !words_of(field).empty())
      choices["--" + dashed(field.flag_name())].assign(words_of(field).begin(),
                                                       words_of(field).end());
  }
}

void add_set_options(CLI::App& app, const StructDecl& decl, void* object) {
  app.add_option_function<std::string>(
         "--size", [&decl, object](const std::string& text) { read_size(decl, object, text); },
         "Width and height of the images.")
      ->type_name("WxH");
  app.add_option_function<std::vector<std::string>>(
         "--set",
         [&decl, object](const std::vector<std::string>& all) {
           for (const std::string& one : all) set_field(decl, object, one);
         },
         "Set any field by its name, including fields without an option. May be repeated.")
      ->type_name("NAME=VALUE")
      ->expected(1)
      ->take_all();
}

void read_size(const StructDecl& decl, void* object, std::string_view text) {
  const std::size_t x = text.find('x');
  const FieldDecl &width = *decl.find("width"), &height = *decl.find("height");
  try {
    if (x == text.npos) throw ValueError("");
    read_text(width, object, text.substr(0, x));
    read_text(height, object, text.substr(x + 1));
    check_field(width, object, "");
    check_field(height, object, "");
  } catch (const ValueError&) {
    throw ValueError(fmt::format("size '{}': expected WIDTHxHEIGHT, such as 640x368", text));
  }
}

}  // namespace mjsense::app
