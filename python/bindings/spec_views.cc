// SPDX-License-Identifier: Apache-2.0
// mjSpec for the views of python/mjsense/core/spec_views.py: a scene's spec without the mujoco package.

#include <mujoco/mjspecmacro.h>
#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <string>
#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/scene/mj_spec.h"
#include "python/bindings/bindings.h"
#include "python/bindings/mujoco_fields.h"

namespace mjsense::python {
namespace {

using Address = std::uintptr_t;

template <class T>
T* at(Address address) {
  return reinterpret_cast<T*>(address);
}
Address address_of(const void* pointer) { return reinterpret_cast<Address>(pointer); }

struct OwnedSpec {
  scene::SpecPtr pointer;
  Address address() const { return address_of(pointer.get()); }
};

// Fields of mjs structs. Fields that are not numbers have a type in words and no shape.
class SpecFields : public Fields {
 public:
  template <class T>
  void value(const char* name, const T& field) {
    if constexpr (!std::is_pointer_v<T> && !std::is_class_v<T>) Fields::value(name, field);
  }
  void value(const char* name, mjString* field) { word(name, field, "string"); }
  void value(const char* name, mjStringVec* field) { word(name, field, "strings"); }
  void value(const char* name, mjDoubleVec* field) { word(name, field, "doubles"); }
  void value(const char* name, mjFloatVec* field) { word(name, field, "floats"); }
  void value(const char* name, mjIntVec* field) { word(name, field, "ints"); }
  void value(const char* name, const mjsOrientation& field) {
    SpecFields fields;
#define X(type, name, n) fields.value(#name, field.name);
#define XVEC X
    MJSORIENTATION_FIELDS
    add(name, fields);
  }
  void value(const char* name, const mjsPlugin& field) {
    SpecFields fields;
    fields.value("name", field.name);
    fields.value("plugin_name", field.plugin_name);
    fields.value("active", field.active);
    add(name, fields);
  }
  void value(const char* name, const mjsCompiler& field) {
    SpecFields fields;
    MJSCOMPILER_FIELDS
    add(name, fields);
#undef X
  }
  void value(const char* name, const mjOption& field) { add(name, option_fields(field)); }
  void value(const char* name, const mjVisual& field) { add(name, visual_fields(field)); }
  void value(const char* name, const mjStatistic& field) { add(name, statistic_fields(field)); }

 private:
  void word(const char* name, const void* field, const char* type) {
    set(name, field, nb::str(type), nb::none());
  }
};

nb::dict spec_fields(Address spec) {
  SpecFields fields;
  const auto* s = at<const mjSpec>(spec);
#define X(type, name, n) fields.value(#name, s->name);
  MJSPEC_FIELDS
#undef X
  return fields.all();
}

nb::dict element_fields(Address address) {
  auto* element = at<mjsElement>(address);
  SpecFields fields;
#define X(type, name, n) fields.value(#name, s->name);
#define KIND(type, as, macro)    \
  case type: {                   \
    const auto* s = as(element); \
    macro break;                 \
  }
  switch (element->elemtype) {
    KIND(mjOBJ_BODY, mjs_asBody, MJSBODY_FIELDS)
    KIND(mjOBJ_GEOM, mjs_asGeom, MJSGEOM_FIELDS)
    KIND(mjOBJ_JOINT, mjs_asJoint, MJSJOINT_FIELDS)
    KIND(mjOBJ_SITE, mjs_asSite, MJSSITE_FIELDS)
    KIND(mjOBJ_CAMERA, mjs_asCamera, MJSCAMERA_FIELDS)
    KIND(mjOBJ_LIGHT, mjs_asLight, MJSLIGHT_FIELDS)
    KIND(mjOBJ_FRAME, mjs_asFrame, MJSFRAME_FIELDS)
    KIND(mjOBJ_ACTUATOR, mjs_asActuator, MJSACTUATOR_FIELDS)
    KIND(mjOBJ_SENSOR, mjs_asSensor, MJSSENSOR_FIELDS)
    KIND(mjOBJ_PAIR, mjs_asPair, MJSPAIR_FIELDS)
    KIND(mjOBJ_EXCLUDE, mjs_asExclude, MJSEXCLUDE_FIELDS)
    KIND(mjOBJ_EQUALITY, mjs_asEquality, MJSEQUALITY_FIELDS)
    KIND(mjOBJ_TENDON, mjs_asTendon, MJSTENDON_FIELDS)
    KIND(mjOBJ_NUMERIC, mjs_asNumeric, MJSNUMERIC_FIELDS)
    KIND(mjOBJ_TEXT, mjs_asText, MJSTEXT_FIELDS)
    KIND(mjOBJ_KEY, mjs_asKey, MJSKEY_FIELDS)
    KIND(mjOBJ_MESH, mjs_asMesh, MJSMESH_FIELDS)
    KIND(mjOBJ_HFIELD, mjs_asHField, MJSHFIELD_FIELDS)
    KIND(mjOBJ_TEXTURE, mjs_asTexture, MJSTEXTURE_FIELDS)
    KIND(mjOBJ_MATERIAL, mjs_asMaterial, MJSMATERIAL_FIELDS)
    default:
      break;
  }
#undef KIND
#undef X
#undef XVEC
  return fields.all();
}

// Adds an element to a body or, where these belong to no body, to the spec; 0: no such kind.
Address add_element(Address spec, Address parent, int kind, const std::optional<std::string>& cls) {
  auto* s = at<mjSpec>(spec);
  auto* body = parent ? mjs_asBody(at<mjsElement>(parent)) : nullptr;
  const mjsDefault* given = cls ? mjs_findDefault(s, cls->c_str()) : nullptr;
  if (cls && !given) throw ValueError("no default class named '" + *cls + "'");
  if (body) {
    switch (kind) {
      case mjOBJ_BODY:
        return address_of(mjs_addBody(body, given)->element);
      case mjOBJ_GEOM:
        return address_of(mjs_addGeom(body, given)->element);
      case mjOBJ_JOINT:
        return address_of(mjs_addJoint(body, given)->element);
      case mjOBJ_SITE:
        return address_of(mjs_addSite(body, given)->element);
      case mjOBJ_CAMERA:
        return address_of(mjs_addCamera(body, given)->element);
      case mjOBJ_LIGHT:
        return address_of(mjs_addLight(body, given)->element);
      default:
        return 0;
    }
  }
  switch (kind) {
    case mjOBJ_ACTUATOR:
      return address_of(mjs_addActuator(s, given)->element);
    case mjOBJ_SENSOR:
      return address_of(mjs_addSensor(s)->element);
    case mjOBJ_PAIR:
      return address_of(mjs_addPair(s, given)->element);
    case mjOBJ_EXCLUDE:
      return address_of(mjs_addExclude(s)->element);
    case mjOBJ_EQUALITY:
      return address_of(mjs_addEquality(s, given)->element);
    case mjOBJ_NUMERIC:
      return address_of(mjs_addNumeric(s)->element);
    case mjOBJ_TEXT:
      return address_of(mjs_addText(s)->element);
    case mjOBJ_KEY:
      return address_of(mjs_addKey(s)->element);
    case mjOBJ_MESH:
      return address_of(mjs_addMesh(s, given)->element);
    case mjOBJ_HFIELD:
      return address_of(mjs_addHField(s)->element);
    case mjOBJ_TEXTURE:
      return address_of(mjs_addTexture(s, given)->element);
    case mjOBJ_MATERIAL:
      return address_of(mjs_addMaterial(s, given)->element);
    default:
      return 0;
  }
}

std::vector<Address> children(Address body, int kind, bool recurse) {
  std::vector<Address> all;
  const auto* b = mjs_asBody(at<mjsElement>(body));
  for (auto* e = mjs_firstChild(b, static_cast<mjtObj>(kind), recurse); e;
       e = mjs_nextChild(b, e, recurse))
    all.push_back(address_of(e));
  return all;
}

nb::object read(Address field, const std::string& type) {
  if (type == "string") return nb::cast(std::string(mjs_getString(at<mjString>(field))));
  if (type == "doubles") {
    int size = 0;
    const double* data = mjs_getDouble(at<mjDoubleVec>(field), &size);
    return nb::cast(std::vector<double>(data, data + size));
  }
  throw nb::type_error("a field of this type can be written, not read");
}

void write(Address field, const std::string& type, nb::handle value) {
  if (type == "string") {
    mjs_setString(at<mjString>(field), nb::cast<std::string>(value).c_str());
  } else if (type == "strings") {
    const auto all = nb::cast<std::vector<std::string>>(value);
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (!mjs_setInStringVec(at<mjStringVec>(field), static_cast<int>(i), all[i].c_str()))
        mjs_appendString(at<mjStringVec>(field), all[i].c_str());
    }
  } else if (type == "doubles") {
    const auto all = nb::cast<std::vector<double>>(value);
    mjs_setDouble(at<mjDoubleVec>(field), all.data(), static_cast<int>(all.size()));
  } else if (type == "floats") {
    const auto all = nb::cast<std::vector<float>>(value);
    mjs_setFloat(at<mjFloatVec>(field), all.data(), static_cast<int>(all.size()));
  } else {
    const auto all = nb::cast<std::vector<int>>(value);
    mjs_setInt(at<mjIntVec>(field), all.data(), static_cast<int>(all.size()));
  }
}

}  // namespace

void bind_spec_views(nb::module_& m) {
  nb::class_<OwnedSpec>(m, "Spec", "An mjSpec: empty, or of XML text or of a file.")
      .def(
          "__init__",
          [](OwnedSpec* self, const std::optional<std::string>& base) {
            if (!base) {
              new (self) OwnedSpec{scene::SpecPtr(mj_makeSpec())};
              return;
            }
            scene::ModelSource source;
            const bool is_text = base->find_first_not_of(" \t\r\n") == base->find('<');
            (is_text ? source.xml : source.path) = *base;
            new (self) OwnedSpec{scene::parse_model(source, "SceneCfg.base")};
          },
          nb::arg("base").none())
      .def_prop_ro("address", &OwnedSpec::address);
  m.def(
      "spec_names",
      [](Address spec, int kind) {
        return scene::spec_names(at<const mjSpec>(spec), static_cast<mjtObj>(kind));
      },
      nb::arg("spec"), nb::arg("kind"), "Names of the elements of an mjSpec, in its order.");
  m.def("spec_fields", &spec_fields, nb::arg("spec"));
  m.def(
      "spec_elements",
      [](Address spec, int kind) {
        std::vector<Address> all;
        for (const auto* e :
             scene::spec_elements(at<const mjSpec>(spec), static_cast<mjtObj>(kind)))
          all.push_back(address_of(e));
        return all;
      },
      nb::arg("spec"), nb::arg("kind"), "Addresses of mjsElement.");
  m.def("spec_children", &children, nb::arg("body"), nb::arg("kind"), nb::arg("recurse"));
  m.def("spec_add", &add_element, nb::arg("spec"), nb::arg("parent"), nb::arg("kind"),
        nb::arg("default").none());
  m.def("spec_delete", [](Address spec, Address element) {
    if (mjs_delete(at<mjSpec>(spec), at<mjsElement>(element)) != 0)
      throw ValueError(mjs_getError(at<mjSpec>(spec)));
  });
  m.def("element_fields", &element_fields, nb::arg("element"));
  m.def("element_kind",
        [](Address element) { return static_cast<int>(at<mjsElement>(element)->elemtype); });
  m.def("element_name",
        [](Address element) { return scene::element_name(at<mjsElement>(element)); });
  m.def("set_element_name", [](Address element, const std::string& name) {
    auto* e = at<mjsElement>(element);
    if (mjs_setName(e, name.c_str()) != 0) throw ValueError(mjs_getError(mjs_getSpec(e)));
  });
  m.def("element_parent", [](Address element) {
    const mjsBody* parent = mjs_getParent(at<mjsElement>(element));
    return parent ? address_of(parent->element) : 0;
  });
  m.def("read_spec_field", &read, nb::arg("field"), nb::arg("type"));
  m.def("write_spec_field", &write, nb::arg("field"), nb::arg("type"), nb::arg("value"));
}

}  // namespace mjsense::python
