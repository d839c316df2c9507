// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <map>

#include "mjsense/app/field_options.h"
#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_value.h"
#include "mjsense/core/files/regular_file.h"

namespace mjsense::app {
namespace {

using Kind = FieldType::Kind;

// Adds the place to the errors of `read`, which parses a value as on the command line.
template <class Read>
void at_place(const std::string& context, Read&& read) {
  try {
    read();
  } catch (const ValueError& e) {
    throw ValueError(fmt::format("{}: {}", context, e.what()));
  }
}

// A key of the file: a field's option, or its negation.
struct Key {
  const FieldDecl* field;
  bool opposite;
};

void read_key(const Key& key, void* object, const toml::node& node, const std::string& context) {
  const FieldDecl& field = *key.field;
  const auto text = node.value_exact<std::string>();
  void* value = at(object, field);
  if (!read_toml_value(*field.type, value, node, context, field.option_name())) {
    // Lists may also be written as on the command line.
    const Kind kind =
        field.type->kind == Kind::kOptional ? field.type->element().kind : field.type->kind;
    if (kind != Kind::kList || !text)
      throw ValueError(fmt::format("{}: the value of '{}' has the wrong type: must be {}", context,
                                   field.option_name(), expected(*field.type)));
    at_place(context, [&] { read_text(field, object, *text); });
  }
  if (key.opposite) *static_cast<bool*>(value) = !*static_cast<bool*>(value);
  check_field(field, object, context);
}

}  // namespace

void read_toml(const std::string& path, const StructDecl& decl, void* object) {
  read_toml_text(read_text_file(path), path, decl, object);
}

void read_toml_text(std::string_view text, const std::string& path, const StructDecl& decl,
                    void* object) {
  const toml::table table = parse_toml(text, path);
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
    const std::string context = toml_context(path, node);
    if (name == "size") {
      const auto text = node.value_exact<std::string>();
      if (!text)
        throw ValueError(
            fmt::format("{}: the value of 'size' has the wrong type: must be a str", context));
      at_place(context, [&] { read_size(decl, object, *text); });
      continue;
    }
    const auto found = known.find(name);
    if (found == known.end()) throw_unknown(context, "key", name, names);
    read_key(found->second, object, node, context);
  }
}

}  // namespace mjsense::app
