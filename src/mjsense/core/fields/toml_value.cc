// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/toml_value.h"

#include <fmt/format.h>

#include <filesystem>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"

namespace mjsense {
namespace {

using Kind = FieldType::Kind;

}  // namespace

toml::table parse_toml(std::string_view text, const std::string& path) {
  try {
    return toml::parse(text);
  } catch (const toml::parse_error& e) {
    throw ValueError(
        fmt::format("{}:{}: {}", path, e.source().begin.line, std::string(e.description())));
  }
}

std::string toml_context(const std::string& path, const toml::node& node) {
  return fmt::format("{}:{}", path, node.source().begin.line);
}

bool read_toml_value(const FieldType& type, void* out, const toml::node& node,
                     std::string_view context, std::string_view name) {
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
    case Kind::kEnum: {
      const auto value = node.value_exact<std::string>();
      if (value) set_integer(type, out, enum_index(*value, type.words, context, name));
      return value.has_value();
    }
    case Kind::kOptional:
      type.clear(out);
      return read_toml_value(type.element(), type.append(out), node, context, name);
    case Kind::kArray: {
      const toml::array* list = node.as_array();
      if (!list || list->size() != type.count(out)) return false;
      for (std::size_t i = 0; i < list->size(); ++i) {
        if (!read_toml_value(type.element(), type.at(out, i), *list->get(i), context, name))
          return false;
      }
      return true;
    }
    case Kind::kList: {
      const toml::array* list = node.as_array();
      type.clear(out);
      for (std::size_t i = 0; list && i < list->size(); ++i) {
        if (!read_toml_value(type.element(), type.append(out), *list->get(i), context, name))
          return false;
      }
      return list;
    }
    case Kind::kMap:
    case Kind::kObject:
    case Kind::kChoice:
      break;
  }
  return false;
}

}  // namespace mjsense
