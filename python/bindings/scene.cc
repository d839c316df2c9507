// SPDX-License-Identifier: Apache-2.0
// Bindings of scenes. python/mjsense/scene/scene.py defines the public class.

#include "python/bindings/scene.h"

#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "mjsense/core/error.h"
#include "mjsense/core/files/embedded_files.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/scene/backdrop.h"
#include "mjsense/scene/compiled_model.h"
#include "mjsense/scene/resolve.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/mujoco_callbacks.h"
#include "python/bindings/numpy.h"
#include "python/bindings/python_sensor.h"
#include "python/bindings/schema.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {

namespace {

mjSpec* spec_of(nb::handle mjspec) {
  return reinterpret_cast<mjSpec*>(nb::cast<std::uintptr_t>(mjspec.attr("_address")));
}

// Reads an EntityCfg's `model` as returned by EntityCfg._source(): ("path" | "xml" | "spec",
// value). Referenced objects are added to `alive`.
scene::ModelSource read_source(nb::handle config, nb::list& alive) {
  scene::ModelSource source;
  const auto from = nb::cast<nb::tuple>(config.attr("_source")());
  alive.append(from);
  const auto kind = nb::cast<std::string>(from[0]);
  if (kind == "path") source.path = nb::cast<std::string>(from[1]);
  if (kind == "xml") source.xml = nb::cast<std::string>(from[1]);
  if (kind == "spec") source.spec = spec_of(from[1]);
  for (auto [name, bytes] : nb::cast<nb::dict>(from[2])) {
    const auto data = nb::cast<nb::bytes>(bytes);
    source.assets[nb::cast<std::string>(name)] = std::string(data.c_str(), data.size());
  }
  return source;
}

// A sensor written in Python in a scene's list of sensors.
class PythonSensorCfg final : public SensorCfg {
 public:
  PythonSensorCfg(std::string key, nb::handle sensor, PythonSensorSpec spec)
      : sensor_(sensor), spec_(std::move(spec)) {
    name = std::move(key);
  }
  std::unique_ptr<Sensor> build() const override {
    return std::make_unique<PythonSensor>(name, sensor_, spec_);
  }

 private:
  WeakObject sensor_;
  PythonSensorSpec spec_;
};

std::shared_ptr<const SensorCfg> read_sensor(nb::handle item) {
  if (!nb::hasattr(item, "_mjs_compute_rows")) return read_sensor_cfg(item);
  return std::make_shared<PythonSensorCfg>(nb::cast<std::string>(item.attr("uuid")), item,
                                           read_python_spec(item));
}

// `model`: address of a compiled model that the scene uses instead of its own; 0: none.
std::shared_ptr<scene::Scene> make_scene(nb::handle config, nb::handle spec, nb::list sensors,
                                         nb::object edit, std::uintptr_t model) {
  refuse_python_callbacks();  // compilation may call them too
  nb::list alive;
  scene::SceneCfg cfg = read_scene(config, spec, sensors, edit, alive);
  nb::gil_scoped_release unlock;
  std::optional<scene::CompiledModel> compiled;
  if (model) compiled.emplace(reinterpret_cast<const mjModel*>(model), cfg.spec);
  auto scene = std::make_shared<scene::Scene>(std::move(cfg));
  if (compiled) compiled->replace_model(*scene);
  return scene;
}

nb::dict entity_names(const scene::Entity& e) {
  nb::dict names;
  const auto add = [&](const char* key, const std::vector<std::string>& list) {
    nb::list items;
    for (const auto& item : list) items.append(item);
    names[key] = nb::tuple(items);
  };
  add("body_names", e.body_names);
  add("geom_names", e.geom_names);
  add("site_names", e.site_names);
  add("joint_names", e.joint_names);
  add("actuator_names", e.actuator_names);
  add("tendon_names", e.tendon_names);
  add("camera_names", e.camera_names);
  names["fixed_base"] = e.fixed_base;
  return names;
}

template <class T, class From>
NumpyArray array_of(const std::vector<From>& values, const Shape& shape) {
  auto array = std::make_shared<Array>(dtype_of<T>(), shape);
  auto out = array->template all<T>();
  for (std::size_t i = 0; i < values.size(); ++i) out[i] = static_cast<T>(values[i]);
  return to_numpy(array->view(), owner_of(array));
}

NumpyArray env_origins(const scene::Scene& scene, int num_worlds) {
  return array_of<float>(scene.env_origins(num_worlds), {num_worlds, 3});
}

// Generated terrain; null if there is none.
const scene::Terrain* tiles_of(const scene::Scene& scene) {
  return scene.terrain() && scene.terrain()->levels() > 0 ? scene.terrain() : nullptr;
}

std::optional<NumpyArray> env_tiles(const scene::Scene& scene, int num_worlds) {
  const scene::Terrain* tiles = tiles_of(scene);
  if (!tiles) return std::nullopt;
  return array_of<std::int32_t>(tiles->env_tiles(num_worlds), {num_worlds, 2});
}

std::optional<NumpyArray> tile_origins(const scene::Scene& scene) {
  const scene::Terrain* tiles = tiles_of(scene);
  if (!tiles) return std::nullopt;
  return array_of<float>(tiles->tile_origins(), {tiles->levels(), tiles->types(), 3});
}

}  // namespace

scene::SceneCfg read_scene(nb::handle config, nb::handle spec, nb::list sensors, nb::handle edit,
                           nb::list& alive) {
  scene::SceneCfg cfg;
  read_struct(config, cfg);
  std::size_t i = 0;
  for (auto [name, entity] : dict_of(config.attr("entities")))
    cfg.entities[i++].second.model = read_source(entity, alive);
  for (nb::handle sensor : sensors) cfg.sensors.push_back(read_sensor(sensor));
  cfg.spec = spec_of(spec);
  // The files of an archive, for dataset/episode_worlds.py. All that the base names are among them.
  if (nb::hasattr(config, "_mjs_members")) {
    for (auto [name, bytes] : nb::cast<nb::dict>(config.attr("_mjs_members"))) {
      const auto data = nb::cast<nb::bytes>(bytes);
      cfg.base.assets[nb::cast<std::string>(name)] = std::string(data.c_str(), data.size());
    }
  }
  // Called once during construction of the Scene; afterwards the stored config may be destroyed
  // without the GIL.
  cfg.spec_fn = [edit](mjSpec*) {
    nb::gil_scoped_acquire lock;
    edit();
  };
  return cfg;
}

// scene::BackdropConverter.
static std::string converted_backdrop(const std::string& path) {
  const nb::gil_scoped_acquire gil;
  const nb::object convert = nb::module_::import_("mjsense.scene.backdrop").attr("backdrop_model");
  return nb::cast<std::string>(convert(path));
}

void bind_scene(nb::module_& m) {
  scene::set_backdrop_converter(&converted_backdrop);
  m.def(
      "check_obj_type", [](const std::string& type) { scene::obj_type(type, "ObjRef"); },
      nb::arg("type"), "Raises if MuJoCo has no type of elements of this name.");
  m.def("check_cfg", &check_cfg, nb::arg("config"), "Raises if a configuration is wrong.");
  m.def(
      "check_options",
      [](const std::string& name, nb::dict options) {
        const StructDecl* found = find_struct(name);
        if (!found) throw nb::key_error(name.c_str());
        const StructDecl& decl = *found;
        const std::shared_ptr<void> object = decl.make();
        read_options(options, decl, object.get());
        check_fields(decl, object.get(), "");
      },
      nb::arg("struct"), nb::arg("options"), "Raises if a value of a struct's field is wrong.");
  m.def(
      "cfg_key", [](nb::handle config) { return read_sensor_cfg(config)->key(); },
      "Key in a scene's registry.");
  m.def("schema", &schema_json, "All configurations and data classes, as JSON.");
  m.def(
      "embedded_models",
      [] {
        nb::list names;
        for (const EmbeddedFile& file : embedded_files()) {
          if (file.name.ends_with(".xml")) names.append(std::string(file.name));
        }
        return names;
      },
      "Names of the models that are part of mjsense: EntityCfg(model=\"embedded:<name>\").");

  nb::class_<SensorHandle>(m, "SensorHandle", "A C++ sensor.")
      .def_prop_ro("name", [](const SensorHandle& h) { return h.sensor->name(); })
      .def_prop_ro("kind", [](const SensorHandle& h) { return std::string(h.sensor->kind()); })
      .def_prop_ro("bytes_per_world",
                   [](const SensorHandle& h) { return h.sensor->bytes_per_world(); })
      .def_prop_ro(
          "has_memory",
          [](const SensorHandle& h) {
            const auto* python = dynamic_cast<const PythonSensor*>(h.sensor.get());
            return h.sensor->wants_substep() || h.sensor->needs_every_step() ||
                   (python && python->updates());
          },
          "Whether its rows depend on the steps since the start of the episode.")
      .def(
          "specs",
          [](const SensorHandle& h) {
            nb::dict specs;
            for (const Field& field : h.sensor->fields())
              specs[field.name.c_str()] = nb::cast(field.spec, nb::rv_policy::copy);
            return specs;
          },
          "SensorSpec of each field; empty before the simulation exists.")
      .def(
          "arrays",
          [](const SensorHandle& h, bool writable) {
            nb::dict arrays;
            nb::object owner = owner_of(h.sensor);
            for (Field& field : h.sensor->fields())
              arrays[field.name.c_str()] =
                  (writable ? to_numpy : to_readonly_numpy)(field.data.view(), owner);
            return arrays;
          },
          nb::arg("writable") = false,
          "The rows [B, ...] of each field, without a copy; writable for who computes them.")
      .def("python_object", [](const SensorHandle& h) -> nb::object {
        auto* sensor = dynamic_cast<PythonSensor*>(h.sensor.get());
        return sensor ? sensor->self() : nb::none();
      });

  nb::class_<scene::Scene>(m, "Scene", "The C++ scene.")
      .def_static("make", &make_scene, nb::arg("config"), nb::arg("spec"), nb::arg("sensors"),
                  nb::arg("edit"), nb::arg("model") = 0,
                  "model: address of a compiled model for a scene that compiles none.")
      .def(
          "set_options",
          [](scene::Scene& s, nb::handle config, std::uintptr_t copy) {
            scene::OptionsCfg options;
            read_struct(config, options);
            s.set_options(options);
            reinterpret_cast<mjModel*>(copy)->opt = s.model()->opt;
          },
          nb::arg("config"), nb::arg("copy"),
          "Replaces the physics options, also of a copy of the model at this address.")
      .def("to_xml", &scene::Scene::to_xml)
      .def("assets",
           [](const scene::Scene& s) {
             nb::dict assets;
             for (const auto& [name, bytes] : s.assets())
               assets[name.c_str()] = nb::bytes(bytes.data(), bytes.size());
             return assets;
           })
      .def("warnings",
           [](const scene::Scene& s) {
             std::vector<std::string> texts;
             for (const std::string& text : s.warnings()) texts.push_back(printable_lines(text));
             return texts;
           })
      .def(
          "copy_model",
          [](const scene::Scene& s) {
            return reinterpret_cast<std::uintptr_t>(call_mujoco(mj_copyModel, nullptr, s.model()));
          },
          "Address of a copy of the mjModel, which the caller owns.")
      .def("sensors",
           [](std::shared_ptr<scene::Scene> s) {
             nb::list handles;
             for (const auto& sensor : s->sensors())
               handles.append(SensorHandle{std::shared_ptr<Sensor>(s, sensor.get())});
             return handles;
           })
      .def("entities",
           [](const scene::Scene& s) {
             nb::dict all;
             for (const scene::Entity& entity : s.entities())
               all[entity.name.c_str()] = entity_names(entity);
             return all;
           })
      .def("env_tiles", &env_tiles, nb::arg("num_worlds"))
      .def("tile_origins", &tile_origins)
      .def("env_origins", &env_origins, nb::arg("num_worlds"));
}

}  // namespace mjsense::python
