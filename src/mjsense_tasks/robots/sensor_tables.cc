// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/sensor_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <string_view>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/sensors/all_sensors.h"
#include "mjsense_tasks/robots/robot.h"

namespace mjsense::tasks::robots {
namespace {

using Kind = FieldType::Kind;

constexpr std::string_view kPython = "python";
// Kinds that are not allowed here: cameras have their own tables, and an effect refers to another
// sensor of the scene by its key.
constexpr std::string_view kNotHere[] = {"camera", "effect"};

std::string robot_entity() {
  return std::string(Robot::kPrefix.substr(0, Robot::kPrefix.size() - 1));
}

void name_entity(const StructDecl& decl, void* object);

void name_entity(const FieldType& type, void* value) {
  switch (type.kind) {
    case Kind::kObject:
      return name_entity(type.object(), value);
    case Kind::kChoice:
      return name_entity(*type.alternatives()[type.which(value)], type.get(value));
    case Kind::kArray:
    case Kind::kList:
    case Kind::kOptional:
      for (std::size_t i = 0; i < type.count(value); ++i)
        name_entity(type.element(), type.at(value, i));
      return;
    default:
      return;
  }
}

// True if the reference names an element; an empty reference is left unchanged.
bool refers(const StructDecl& decl, void* object) {
  for (const char* key : {"name", "pattern"}) {
    const FieldDecl* field = decl.find(key);
    if (!field || !field->type) continue;
    if (field->type->kind == Kind::kText)
      return !static_cast<const std::string*>(at(object, *field))->empty();
    return field->type->count(at(object, *field)) > 0;
  }
  return false;
}

// Sets the entity of references that have none to the robot's.
void name_entity(const StructDecl& decl, void* object) {
  const FieldDecl* entity = decl.find("entity");
  if (entity && entity->type && entity->type->kind == Kind::kText && refers(decl, object)) {
    auto& name = *static_cast<std::string*>(at(object, *entity));
    if (name.empty()) name = robot_entity();
  }
  for (const FieldDecl& field : decl.fields) {
    if (field.type && std::string_view(field.name) != "secondary")
      name_entity(*field.type, at(object, field));
  }
}

std::string text_of(const toml::table& table, std::string_view key, const std::string& path,
                    const std::string& inside) {
  const toml::node* node = table.get(key);
  const auto text = node ? node->value_exact<std::string>() : std::nullopt;
  if (!text || text->empty()) {
    throw ValueError(fmt::format("{}: '{}': '{}' must be a non-empty string",
                                 toml_context(path, node ? *node : table), inside, key));
  }
  return *text;
}

const std::vector<std::string> kPythonKeys = {"name", "class", "args"};

PythonSensorRef python_sensor(const toml::table& table, const std::string& path,
                              const std::string& inside) {
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    if (name != "kind" && std::ranges::find(kPythonKeys, name) == kPythonKeys.end())
      throw_unknown(toml_context(path, node), fmt::format("key of '{}'", inside), name,
                    kPythonKeys);
  }
  PythonSensorRef out{.name = text_of(table, "name", path, inside),
                      .class_name = text_of(table, "class", path, inside),
                      .args = "{}"};
  if (std::ranges::count(out.class_name, ':') != 1) {
    throw ValueError(fmt::format("{}: '{}': class is '{}': must be 'package.module:Class'",
                                 toml_context(path, table), inside, out.class_name));
  }
  if (const toml::node* args = table.get("args")) {
    if (!args->is_table()) {
      throw ValueError(fmt::format("{}: the value of '{}.args' has the wrong type: must be a table",
                                   toml_context(path, *args), inside));
    }
    std::ostringstream text;
    text << toml::json_formatter(*args->as_table());
    out.args = text.str();
  }
  return out;
}

std::shared_ptr<SensorCfg> built_in_sensor(const toml::table& table, const std::string& kind,
                                           const std::string& path, const std::string& inside) {
  std::vector<std::string> kinds;
  for (const SensorKind& known : sensors::sensor_kinds()) {
    if (std::ranges::find(kNotHere, known.cfg->kind) != std::end(kNotHere)) continue;
    if (kind == known.cfg->kind) {
      void* fields = nullptr;
      std::shared_ptr<SensorCfg> cfg = known.make(&fields);
      read_toml_table(table, path, *known.cfg, fields, inside);
      name_entity(*known.cfg, fields);
      return cfg;
    }
    kinds.emplace_back(known.cfg->kind);
  }
  kinds.emplace_back(kPython);
  throw_unknown(toml_context(path, table), fmt::format("kind of '{}'", inside), kind, kinds);
}

}  // namespace

void take_robot_sensors(toml::table& file, const std::string& path, RobotCfg& cfg) {
  const toml::node* node = file.get("sensors");
  if (!node) return;
  const toml::array* list = node->as_array();
  if (!list || !list->is_homogeneous<toml::table>()) {
    throw ValueError(
        fmt::format("{}: the value of 'sensors' has the wrong type: must be tables, [[sensors]]",
                    toml_context(path, *node)));
  }
  for (std::size_t i = 0; i < list->size(); ++i) {
    const toml::table& table = *list->get(i)->as_table();
    const std::string inside = fmt::format("sensors[{}]", i);
    const std::string kind = text_of(table, "kind", path, inside);
    if (kind == kPython) {
      cfg.python_sensors.push_back(python_sensor(table, path, inside));
    } else {
      cfg.sensors.push_back(built_in_sensor(table, kind, path, inside));
    }
  }
  file.erase("sensors");
}

}  // namespace mjsense::tasks::robots
