// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/fields.h"

#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/string.h>

#include <filesystem>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/sensors/all_sensors.h"
#include "python/bindings/schema.h"

namespace mjsense::python {
namespace {

using Kind = FieldType::Kind;

// For example "ContactSensorCfg 'feet'".
std::string context_of(nb::handle config) {
  if (nb::isinstance<nb::dict>(config)) return "options";
  std::string context = nb::cast<std::string>(config.type().attr("__name__"));
  nb::object name = nb::getattr(config, "name", nb::none());
  if (nb::isinstance<nb::str>(name)) context += " '" + nb::cast<std::string>(name) + "'";
  return context;
}

// Empty for a class: its attributes are the defaults of its fields, not values that were given.
std::string kind_of(nb::handle config) {
  if (nb::isinstance<nb::type_object>(config)) return "";
  nb::object kind = nb::getattr(config, "kind", nb::none());
  return nb::isinstance<nb::str>(kind) ? nb::cast<std::string>(kind) : "";
}

// As in an error: "'two'", or "the class GridPatternCfg; write GridPatternCfg(...)".
std::string text_of(nb::handle value) {
  if (!nb::isinstance<nb::type_object>(value)) return nb::cast<std::string>(nb::repr(value));
  const auto name = nb::cast<std::string>(value.attr("__name__"));
  return "the class " + name + "; write " + name + "(...)";
}

// Converts the value of a configuration's attribute to its declared type.
struct Reader {
  nb::handle config;
  const FieldDecl& field;

  [[noreturn]] void fail(nb::handle value, const FieldType& type) const {
    const std::string text = context_of(config) + ": " + field.name + " must be " + expected(type) +
                             ", not " + text_of(value);
    throw nb::type_error(text.c_str());
  }

  template <class T>
  void scalar(nb::handle value, const FieldType& type, T& out) const {
    constexpr bool kNumber = std::is_arithmetic_v<T>;
    if (kNumber && nb::isinstance<nb::bool_>(value) != std::is_same_v<T, bool>) fail(value, type);
    if (!nb::try_cast<T>(value, out)) fail(value, type);
  }

  void read(nb::handle value, const FieldType& type, void* out) const {
    switch (type.kind) {
      case Kind::kBool:
        return scalar(value, type, *static_cast<bool*>(out));
      case Kind::kUnsigned:
        return scalar(value, type, *static_cast<std::uint64_t*>(out));
      case Kind::kInt: {
        std::int64_t x = 0;
        scalar(value, type, x);
        if (!set_integer(type, out, x)) fail(value, type);
        return;
      }
      case Kind::kNumber: {
        double x = 0;
        scalar(value, type, x);
        return set_number(type, out, x);
      }
      case Kind::kText:
        if (value.is_none() && field.is_or_none) return static_cast<std::string*>(out)->clear();
        return scalar(value, type, *static_cast<std::string*>(out));
      case Kind::kPath:  // names of files need not be UTF-8
        if (!nb::try_cast(value, *static_cast<std::filesystem::path*>(out))) fail(value, type);
        return;
      case Kind::kEnum: {
        std::string text;
        scalar(value, type, text);
        set_integer(type, out, enum_index(text, type.words, context_of(config), field.name));
        return;
      }
      case Kind::kOptional:
        type.clear(out);
        if (!value.is_none()) read(value, type.element(), type.append(out));
        return;
      case Kind::kArray:
      case Kind::kList:
        return list(value, type, out);
      case Kind::kMap:
        type.clear(out);
        for (auto [key, item] : dict_of(value)) {
          void* place = type.append(out);
          scalar(key, type, *type.key_at(out, type.count(out) - 1));
          read(item, type.element(), place);
        }
        return;
      case Kind::kObject:
        if (value.is_none() && field.is_or_none) return;  // leave the optional empty
        return object(value, type.object(), out, type);
      case Kind::kChoice:
        return choice(value, type, out);
    }
  }

  void list(nb::handle value, const FieldType& type, void* out) const {
    const bool fixed = type.kind == Kind::kArray;
    const bool single = nb::isinstance<nb::str>(value) || !nb::hasattr(value, "__iter__");
    if (single && (fixed || value.is_none())) fail(value, type);
    if (!fixed) type.clear(out);
    // A single value is accepted as a list of one.
    if (single) return read(value, type.element(), type.append(out));
    std::size_t i = 0;
    for (nb::handle item : value) {
      if (fixed && i >= type.count(out)) fail(value, type);
      read(item, type.element(), fixed ? type.at(out, i) : type.append(out));
      ++i;
    }
    if (fixed && i != type.count(out)) fail(value, type);
  }

  void object(nb::handle value, const StructDecl& decl, void* out, const FieldType& type) const {
    if (nb::isinstance<nb::type_object>(value)) fail(value, type);
    for (const FieldDecl& f : decl.fields) {
      if (f.type && !nb::hasattr(value, f.name)) fail(value, type);
    }
    read_struct(value, decl, out);
  }

  void choice(nb::handle value, const FieldType& type, void* out) const {
    const auto all = type.alternatives();
    const std::string kind = kind_of(value);
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (kind == all[i]->kind)
        return object(value, *all[i], type.emplace(out, static_cast<int>(i)), type);
    }
    const bool numbers = nb::isinstance<nb::float_>(value) || nb::isinstance<nb::int_>(value) ||
                         nb::hasattr(value, "__iter__");
    if (type.plain < 0 || !numbers) fail(value, type);
    const FieldDecl& first = all[type.plain]->fields.front();
    read(value, *first.type, at(type.emplace(out, type.plain), first));
  }
};

}  // namespace

nb::dict dict_of(nb::handle mapping) {
  return nb::cast<nb::dict>(nb::module_::import_("builtins").attr("dict")(mapping));
}

void read_value(nb::handle config, const FieldDecl& field, nb::handle value, void* out) {
  Reader{config, field}.read(value, *field.type, out);
}

void read_struct(nb::handle config, const StructDecl& decl, void* out) {
  for (const FieldDecl& field : decl.fields) {
    if (!field.type) continue;
    if (!nb::hasattr(config, field.name)) {
      const std::string text = context_of(config) + " has no '" + field.name + "'";
      throw nb::type_error(text.c_str());
    }
    nb::object value = nb::getattr(config, field.name);
    read_value(config, field, value, at(out, field));
  }
}

void read_options(nb::dict options, const StructDecl& decl, void* out) {
  for (auto [key, value] : options) {
    const auto name = nb::cast<std::string>(key);
    std::vector<std::string> names;
    const FieldDecl* found = nullptr;
    for (const FieldDecl& field : decl.fields) {
      if (name == field.name || name == field.option_name()) found = &field;
      names.emplace_back(field.option_name());
    }
    if (!found) throw_unknown("options", "field", name, names);
    read_value(options, *found, value, at(out, *found));
  }
}

std::shared_ptr<SensorCfg> read_sensor_cfg(nb::handle config) {
  const std::string kind = kind_of(config);
  for (const SensorKind& known : sensors::sensor_kinds()) {
    if (kind != known.cfg->kind) continue;
    void* fields = nullptr;
    std::shared_ptr<SensorCfg> cfg = known.make(&fields);
    read_struct(config, *known.cfg, fields);
    return cfg;
  }
  const std::string text = "not a sensor configuration: " + text_of(config);
  throw nb::type_error(text.c_str());
}

void check_cfg(nb::handle config) {
  const std::string kind = kind_of(config);
  for (const SensorKind& known : sensors::sensor_kinds()) {
    if (kind == known.cfg->kind) {
      static_cast<void>(read_sensor_cfg(config)->build());
      return;
    }
  }
  for (nb::handle base : config.type().attr("__mro__")) {
    const StructDecl* decl = find_struct(nb::cast<std::string>(base.attr("__qualname__")));
    if (!decl) continue;
    const std::shared_ptr<void> object = decl->make();
    read_struct(config, *decl, object.get());
    return check_fields(*decl, object.get(), nb::cast<std::string>(config.type().attr("__name__")));
  }
}

}  // namespace mjsense::python
