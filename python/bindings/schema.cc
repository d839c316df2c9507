// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/schema.h"

#include <fmt/format.h>

#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "mjsense/core/fields/fields.h"
#include "mjsense/replay/render_cfg.h"
#include "mjsense/scene/scene.h"
#include "mjsense/sensors/all_sensors.h"
#include "mjsense_tasks/robots/load_robot.h"
#include "mjsense_tasks/rollout/record_job.h"
#include "mjsense_tasks/rollout/registry.h"
#include "mjsense_tasks/scenes/load_scene.h"
#include "mjsense_tasks/scenes/scene_file.h"

namespace mjsense::python {
namespace {

using Json = nlohmann::ordered_json;
using Kind = FieldType::Kind;

constexpr const char* kKindNames[] = {"bool", "int",    "unsigned", "number", "text",
                                      "path", "word",   "array",    "list",   "optional",
                                      "map",  "object", "choice"};

// JSON has no infinity. Single-precision numbers are written with their shortest text.
Json number(double x, std::size_t bytes) {
  if (std::isinf(x)) return x > 0 ? "inf" : "-inf";
  return bytes == sizeof(float) ? std::stod(fmt::format("{}", static_cast<float>(x))) : x;
}

class Schema {
 public:
  void add(const StructDecl& decl) {
    if (structs_.contains(decl.name)) return;
    decls_[decl.name] = &decl;
    // reserves its place in the order, before the structs that it contains
    structs_[decl.name] = {};
    Json out;
    out["kind"] = decl.kind;
    out["module"] = decl.module;
    out["frozen"] = decl.frozen;
    out["doc"] = decl.sentence;
    for (const StructDecl::Base& base : decl.bases)
      out["bases"].push_back(
          {{"name", base.name}, {"doc", base.sentence}, {"frozen", base.frozen}});
    for (const FieldDecl& field : decl.fields) out["fields"].push_back(describe(decl, field));
    structs_[decl.name] = std::move(out);
  }

  void add(const DataClass& data, const char* kind) {
    Json out;
    out["doc"] = data.sentence.text();
    for (const DataField& f : data.fields) {
      out["fields"].push_back({{"name", f.name},
                               {"dtype", dtype_name(f.dtype)},
                               {"shape", f.shape},
                               {"unit", f.unit},
                               {"doc", f.sentence.text()}});
    }
    data_[std::string(data.name)] = std::move(out);
    data_of_kind_[kind] = data.name;
  }

  const std::map<std::string, const StructDecl*, std::less<>>& decls() const { return decls_; }

  std::string text() const {
    const Json names{{"tasks", tasks::rollout::task_names()},
                     {"robots", tasks::robots::robot_names()},
                     {"policies", tasks::rollout::policy_names()},
                     {"scenes", tasks::scenes::scene_names()}};
    return Json{
        {"structs", structs_}, {"data", data_}, {"data_of_kind", data_of_kind_}, {"names", names}}
        .dump(1);
  }

 private:
  Json describe(const StructDecl& decl, const FieldDecl& field) {
    Json out;
    out["name"] = field.name;
    out["owner"] = field.owner;
    out["doc"] = field.sentence;
    if (!field.type) {
      out["python_type"] = field.python_type;
      out["python_default"] = field.python_default;
    } else {
      out["type"] = type(*field.type);
      out["default"] = value(*field.type, at(decl.defaults.get(), field));
      if (field.low > -std::numeric_limits<double>::max()) out["low"] = number(field.low, 8);
      if (field.high < std::numeric_limits<double>::max()) out["high"] = number(field.high, 8);
      out["above_low"] = field.above_low;
      out["words"] = field.words;
      out["option"] = field.option_name();
      out["flag"] = field.flag_name();
      out["hidden"] = field.is_hidden;
    }
    out["unit"] = field.unit_;
    out["required"] = field.is_required;
    out["or_none"] = field.is_or_none;
    out["or_one"] = field.is_or_one;
    return out;
  }

  Json type(const FieldType& t) {
    Json out{{"kind", kKindNames[static_cast<int>(t.kind)]}};
    if (t.element) out["element"] = type(t.element());
    if (t.kind == Kind::kEnum) out["words"] = t.words;
    if (t.object) {
      add(t.object());
      out["name"] = t.object().name;
    }
    if (t.choice) {
      out["name"] = t.choice;
      for (const StructDecl* decl : t.alternatives()) {
        add(*decl);
        out["alternatives"].push_back(decl->name);
      }
      out["plain"] = t.plain >= 0;
    }
    return out;
  }

  Json fields(const StructDecl& decl, const void* object) {
    Json out{{"class", decl.name}, {"fields", Json::object()}};
    for (const FieldDecl& f : decl.fields) {
      if (f.type) out["fields"][f.name] = value(*f.type, at(object, f));
    }
    return out;
  }

  Json value(const FieldType& t, const void* value) {
    void* v = const_cast<void*>(value);
    switch (t.kind) {
      case Kind::kBool:
        return *static_cast<const bool*>(value);
      case Kind::kInt:
        return get_integer(t, value);
      case Kind::kUnsigned:
        return *static_cast<const std::uint64_t*>(value);
      case Kind::kNumber:
        return number(get_number(t, value), t.bytes);
      case Kind::kText:
        return *static_cast<const std::string*>(value);
      case Kind::kPath:
        return static_cast<const std::filesystem::path*>(value)->string();
      case Kind::kEnum:
        return t.words[get_integer(t, value)];
      case Kind::kOptional:
        return t.count(v) ? this->value(t.element(), t.at(v, 0)) : Json();
      case Kind::kArray:
      case Kind::kList: {
        Json list = Json::array();
        for (std::size_t i = 0; i < t.count(v); ++i)
          list.push_back(this->value(t.element(), t.at(v, i)));
        return list;
      }
      case Kind::kMap: {
        Json map = Json::object();
        for (std::size_t i = 0; i < t.count(v); ++i)
          map[*t.key_at(v, i)] = this->value(t.element(), t.at(v, i));
        return map;
      }
      case Kind::kObject:
        return fields(t.object(), value);
      case Kind::kChoice:
        return fields(*t.alternatives()[t.which(value)], t.get(v));
    }
    return {};
  }

  std::map<std::string, const StructDecl*, std::less<>> decls_;
  Json structs_ = Json::object(), data_ = Json::object(), data_of_kind_ = Json::object();
};

const Schema& schema() {
  static const Schema kSchema = [] {
    Schema schema;
    schema.add(struct_of<scene::SceneCfg>());
    for (const SensorKind& kind : sensors::sensor_kinds()) {
      schema.add(*kind.cfg);
      if (kind.data) schema.add(*kind.data, kind.cfg->kind);
    }
    schema.add(struct_of<tasks::scenes::SceneFileCfg>());
    schema.add(struct_of<tasks::rollout::RecordJobCfg>());
    schema.add(struct_of<tasks::rollout::RolloutCfg>());
    schema.add(struct_of<replay::RenderCfg>());
    schema.add(struct_of<sensors::ImageCfg>());
    schema.add(struct_of<sensors::RgbCfg>());
    schema.add(struct_of<record::FilesCfg>());
    schema.add(struct_of<record::VideoCfg>());
    return schema;
  }();
  return kSchema;
}

}  // namespace

std::string schema_json() { return schema().text(); }

const StructDecl* find_struct(std::string_view name) {
  const auto found = schema().decls().find(name);
  return found == schema().decls().end() ? nullptr : found->second;
}

}  // namespace mjsense::python
