// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/fields/toml_fields.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/toml_value.h"

namespace mjsense {
namespace {

using Kind = FieldType::Kind;

class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {}

  // `inside` is the key path of this table: "groups[1].controller"; "" at the top level.
  void table(const StructDecl& decl, void* object, const toml::table& table,
             const std::string& inside) const {
    std::vector<std::string> names;
    for (const FieldDecl& field : decl.fields) {
      if (field.type) names.emplace_back(field.name);
    }
    for (const auto& [key, node] : table) {
      const std::string name(key.str());
      // the key that selected this alternative
      if (name == "kind" && *decl.kind && !decl.find(name)) continue;
      const FieldDecl* field = decl.find(name);
      const std::string context = toml_context(path_, node);
      if (!field || !field->type) {
        throw_unknown(context, inside.empty() ? "key" : fmt::format("key of '{}'", inside), name,
                      names);
      }
      value(*field->type, at(object, *field), node,
            inside.empty() ? name : fmt::format("{}.{}", inside, name));
      check_field(*field, object, place_in(context, inside));
    }
    const std::string context = toml_context(path_, table);
    for (const FieldDecl& field : decl.fields) {
      if (field.is_required && !table.contains(field.name)) {
        throw ValueError(fmt::format("{}: {}'{}' is missing: {}", context,
                                     inside.empty() ? "" : fmt::format("'{}': ", inside),
                                     field.name, field.sentence));
      }
    }
    if (decl.validate) decl.validate(object, place_in(context, inside));
  }

 private:
  static std::string place_in(const std::string& context, const std::string& inside) {
    return inside.empty() ? context : fmt::format("{}: {}", context, inside);
  }

  [[noreturn]] void wrong(const FieldType& type, const toml::node& node,
                          const std::string& name) const {
    throw ValueError(fmt::format("{}: the value of '{}' has the wrong type: must be {}",
                                 toml_context(path_, node), name, expected(type)));
  }

  void value(const FieldType& type, void* out, const toml::node& node,
             const std::string& name) const {
    switch (type.kind) {
      case Kind::kObject:
        if (!node.is_table()) wrong(type, node, name);
        return table(type.object(), out, *node.as_table(), name);
      case Kind::kChoice:
        return choice(type, out, node, name);
      case Kind::kOptional:
        type.clear(out);
        return value(type.element(), type.append(out), node, name);
      case Kind::kMap:
        if (!node.is_table()) wrong(type, node, name);
        type.clear(out);
        for (const auto& [key, entry] : *node.as_table()) {
          void* element = type.append(out);
          *type.key_at(out, type.count(out) - 1) = key.str();
          value(type.element(), element, entry, fmt::format("{}.{}", name, key.str()));
        }
        return;
      case Kind::kList: {
        const Kind element = type.element().kind;
        if (element != Kind::kObject && element != Kind::kChoice) break;
        if (!node.is_array()) wrong(type, node, name);
        type.clear(out);
        const toml::array& list = *node.as_array();
        for (std::size_t i = 0; i < list.size(); ++i)
          value(type.element(), type.append(out), *list.get(i), fmt::format("{}[{}]", name, i));
        return;
      }
      default:
        break;
    }
    if (!read_toml_value(type, out, node, toml_context(path_, node), name)) wrong(type, node, name);
  }

  // A choice is a table with a `kind`, or only that word if all other fields have their defaults.
  void choice(const FieldType& type, void* out, const toml::node& node,
              const std::string& name) const {
    const toml::table* table = node.as_table();
    const toml::node* kind = table ? table->get("kind") : &node;
    const std::string context = toml_context(path_, node);
    std::vector<std::string_view> kinds;
    for (const StructDecl* decl : type.alternatives()) kinds.emplace_back(decl->kind);
    if (!kind)
      throw ValueError(
          fmt::format("{}: '{}' needs a kind: one of {}", context, name, fmt::join(kinds, ", ")));
    const auto word = kind->value_exact<std::string>();
    if (!word) wrong(type, node, name);
    const int which = enum_index(*word, kinds, context, fmt::format("{}.kind", name));
    void* object = type.emplace(out, which);
    if (table) this->table(*type.alternatives()[which], object, *table, name);
  }

  const std::string& path_;
};

}  // namespace

void read_toml_table(const toml::table& table, const std::string& path, const StructDecl& decl,
                     void* object, const std::string& inside) {
  Reader(path).table(decl, object, table, inside);
}

void read_toml_fields(std::string_view text, const std::string& path, const StructDecl& decl,
                      void* object) {
  read_toml_table(parse_toml(text, path), path, decl, object, "");
}

}  // namespace mjsense
