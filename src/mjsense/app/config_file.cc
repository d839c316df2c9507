// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <toml++/toml.h>

#include <filesystem>

#include "mjsense/app/field_options.h"
#include "mjsense/core/error.h"

namespace mjsense {
namespace {

using Kind = FieldType::Kind;

// False if the value is of another type, or does not fit.
bool read_node(const FieldType& type, void* out, const toml::node& node) {
  switch (type.kind) {
    case Kind::kBool: {
      const auto value = node.value_exact<bool>();
      if (value) *static_cast<bool*>(out) = *value;
      return value.has_value();
    }
    case Kind::kInt:
    case Kind::kUnsigned: {
      const auto value = node.value_exact<std::int64_t>();
      return value && set_integer(type, out, *value);
    }
    case Kind::kNumber: {
      const auto value = node.value<double>();
      if (value && node.is_number()) set_number(type, out, *value);
      return value && node.is_number();
    }
    case Kind::kText: {
      const auto value = node.value_exact<std::string>();
      if (value) *static_cast<std::string*>(out) = *value;
      return value.has_value();
    }
    case Kind::kPath: {
      const auto value = node.value_exact<std::string>();
      if (value) *static_cast<std::filesystem::path*>(out) = *value;
      return value.has_value();
    }
    case Kind::kOptional:
      type.clear(out);
      return read_node(type.element(), type.append(out), node);
    case Kind::kList: {
      const toml::array* list = node.as_array();
      type.clear(out);
      for (std::size_t i = 0; list && i < list->size(); ++i) {
        if (!read_node(type.element(), type.append(out), *list->get(i))) return false;
      }
      return list;
    }
    default:
      return false;
  }
}

// A key of the file: a field's option, or its opposite.
struct Key {
  const FieldDecl* field;
  bool opposite;
};

void read_key(const Key& key, void* object, const toml::node& node, const std::string& place) {
  const FieldDecl& field = *key.field;
  const auto text = node.value_exact<std::string>();
  void* value = at(object, field);
  if (!read_node(*field.type, value, node)) {
    // Lists may also be written as on the command line.
    const Kind kind =
        field.type->kind == Kind::kOptional ? field.type->element().kind : field.type->kind;
    if (kind != Kind::kList || !text)
      throw ValueError(fmt::format("{}: the value of '{}' is of a wrong type: must be {}", place,
                                   field.option_name(), expected(*field.type)));
    read_text(field, object, *text);
  }
  if (key.opposite) *static_cast<bool*>(value) = !*static_cast<bool*>(value);
  check_field(field, object, place);
}

}  // namespace

void read_toml(const std::string& path, const StructDecl& decl, void* object) {
  if (!std::filesystem::is_regular_file(path)) {
    throw ValueError(fmt::format("{}: no such file", path));
  }
  toml::table table;
  try {
    table = toml::parse_file(path);
  } catch (const toml::parse_error& e) {
    throw ValueError(
        fmt::format("{}:{}: {}", path, e.source().begin.line, std::string(e.description())));
  }
  std::map<std::string, Key> known;
  std::vector<std::string> names = {"size"};
  for (const FieldDecl& field : decl.fields) {
    known[field.option_name()] = {&field, false};
    if (field.type->kind == Kind::kBool)
      known[fmt::format("no_{}", field.option_name())] = {&field, true};
  }
  for (const auto& [name, key] : known) names.push_back(name);
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    const auto place = fmt::format("{}:{}", path, node.source().begin.line);
    if (name == "size") {
      const auto text = node.value_exact<std::string>();
      if (!text)
        throw ValueError(
            fmt::format("{}: the value of 'size' is of a wrong type: must be a str", place));
      read_size(decl, object, *text);
      continue;
    }
    const auto found = known.find(name);
    if (found == known.end()) throw_unknown(place, "key", name, names);
    read_key(found->second, object, node, place);
  }
}

}  // namespace mjsense
