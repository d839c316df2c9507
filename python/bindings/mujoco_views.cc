// SPDX-License-Identifier: Apache-2.0
// Where the fields of MuJoCo's structs are, for the views of python/mjsense/core/mujoco_names.py: MjModel and MjData without the mujoco package.

#include <mujoco/mjxmacro.h>
#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "mjsense/core/model_indices.h"
#include "mjsense/core/mujoco_call.h"
#include "mjsense/scene/compiled_model.h"
#include "mjsense/scene/physics_options.h"
#include "python/bindings/bindings.h"
#include "python/bindings/mujoco_fields.h"

namespace mjsense::python {

namespace {

// The data type of a struct, as the arguments of numpy.dtype().
class StructType {
 public:
  explicit StructType(std::size_t size) { type_["itemsize"] = size; }
  template <class T>
  void add(const char* name, std::size_t offset) {
    names_.append(name);
    offsets_.append(offset);
    if constexpr (std::is_array_v<T>)
      formats_.append(
          nb::make_tuple(numpy_type<std::remove_extent_t<T>>(), nb::make_tuple(std::extent_v<T>)));
    else
      formats_.append(numpy_type<T>());
  }
  nb::dict done() {
    type_["names"] = names_;
    type_["formats"] = formats_;
    type_["offsets"] = offsets_;
    return type_;
  }

 private:
  nb::dict type_;
  nb::list names_, formats_, offsets_;
};

}  // namespace

#define FIELD(field) type.add<decltype(Struct::field)>(#field, offsetof(Struct, field))

template <>
nb::object numpy_type<mjContact>() {
  using Struct = mjContact;
  StructType type(sizeof(Struct));
  FIELD(dist);
  FIELD(pos);
  FIELD(frame);
  FIELD(includemargin);
  FIELD(friction);
  FIELD(solref);
  FIELD(solreffriction);
  FIELD(solimp);
  FIELD(adhesion);
  FIELD(surfacevel);
  FIELD(mu);
  FIELD(H);
  FIELD(dim);
  FIELD(geom1);
  FIELD(geom2);
  FIELD(geom);
  FIELD(flex);
  FIELD(elem);
  FIELD(vert);
  FIELD(exclude);
  FIELD(efc_address);
  return type.done();
}

template <>
nb::object numpy_type<mjSolverStat>() {
  using Struct = mjSolverStat;
  StructType type(sizeof(Struct));
  FIELD(improvement);
  FIELD(gradient);
  FIELD(lineslope);
  FIELD(nactive);
  FIELD(nchange);
  FIELD(neval);
  FIELD(nupdate);
  return type.done();
}

template <>
nb::object numpy_type<mjWarningStat>() {
  using Struct = mjWarningStat;
  StructType type(sizeof(Struct));
  FIELD(lastinfo);
  FIELD(number);
  return type.done();
}

template <>
nb::object numpy_type<mjTimerStat>() {
  using Struct = mjTimerStat;
  StructType type(sizeof(Struct));
  FIELD(duration);
  FIELD(number);
  return type.done();
}

Fields option_fields(const mjOption& opt) {
  Fields fields;
#define X(type, name, n) fields.value(#name, opt.name);
#define XVEC X
  MJOPTION_FIELDS
#undef X
#undef XVEC
  return fields;
}

Fields statistic_fields(const mjStatistic& stat) {
  Fields fields;
#define X(name, n) fields.value(#name, stat.name);
#define XVEC X
  MJSTATISTIC_FIELDS
#undef X
#undef XVEC
  return fields;
}

Fields visual_fields(const mjVisual& vis) {
  Fields fields;
#define X(type, name, n) group.value(#name, part.name);
#define XVEC X
#define GROUP(macro, member, shown) \
  {                                 \
    Fields group;                   \
    const auto& part = vis.member;  \
    macro fields.add(shown, group); \
  }
  GROUP(MJVISUAL_GLOBAL_FIELDS, global, "global_")
  GROUP(MJVISUAL_QUALITY_FIELDS, quality, "quality")
  GROUP(MJVISUAL_HEADLIGHT_FIELDS, headlight, "headlight")
  GROUP(MJVISUAL_MAP_FIELDS, map, "map")
  GROUP(MJVISUAL_SCALE_FIELDS, scale, "scale")
  GROUP(MJVISUAL_RGBA_FIELDS, rgba, "rgba")
#undef X
#undef XVEC
  return fields;
}

namespace {

nb::dict model_fields(std::uintptr_t address) {
  const auto* m = reinterpret_cast<const mjModel*>(address);
  Fields fields;
#define X(name) fields.value(#name, m->name);
  MJMODEL_SIZES
  MJSETCONST_SCALARS
#undef X
  fields.value("signature", m->signature);
#define X(type, name, nr, nc) fields.array<type>(#name, m->name, m->nr, nc, #nc);
  MJMODEL_POINTERS_PREAMBLE(m)
  MJMODEL_POINTERS
#undef X
  fields.add("opt", option_fields(m->opt));
  fields.add("vis", visual_fields(m->vis));
  fields.add("stat", statistic_fields(m->stat));
  return fields.all();
}

// A model of these sizes whose arrays are 0, with default options.
std::uintptr_t make_model(nb::dict sizes) {
  mjModel fields{};
  mj_defaultOption(&fields.opt);
  mj_defaultVisual(&fields.vis);
#define X(name) \
  if (sizes.contains(#name)) fields.name = nb::cast<decltype(fields.name)>(sizes[#name]);
  MJMODEL_SIZES
#undef X
  const mjModel* m = &fields;
  MJMODEL_POINTERS_PREAMBLE(m)
  std::int64_t largest = 0;
#define X(type, name, nr, nc) \
  largest = std::max<std::int64_t>(largest, sizeof(type) * m->nr * (nc));
  MJMODEL_POINTERS
#undef X
  const std::vector<char> zeros(largest + 1);
#define X(type, name, nr, nc) \
  fields.name = reinterpret_cast<type*>(const_cast<char*>(zeros.data()));
  MJMODEL_POINTERS
#undef X
  return reinterpret_cast<std::uintptr_t>(scene::copy_fields(fields).release());
}

nb::dict data_fields(std::uintptr_t model, std::uintptr_t address) {
  const auto* m = reinterpret_cast<const mjModel*>(model);
  const auto* d = reinterpret_cast<const mjData*>(address);
  Fields fields;
#define X(type, name, nr, nc) fields.array<type>(#name, d->name, m->nr, nc, #nc);
  MJDATA_POINTERS
#undef X
#define X(type, name) fields.value(#name, d->name);
  MJDATA_SCALAR
#undef X
#define X(type, name, nr, nc) fields.array<type>(#name, d->name, nr * nc, 1, "1");
  MJDATA_VECTOR
#undef X
  return fields.all();
}

// Those that MuJoCo allocates anew in every step.
nb::dict arena_fields(std::uintptr_t model, std::uintptr_t address) {
  const auto* m = reinterpret_cast<const mjModel*>(model);
  const auto* d = reinterpret_cast<const mjData*>(address);
  Fields fields;
#undef MJ_M
#undef MJ_D
#define MJ_M(n) m->n
#define MJ_D(n) d->n
#define X(type, name, nr, nc) fields.array<type>(#name, d->name, nr, nc, #nc);
  MJDATA_ARENA_POINTERS
#undef X
  return fields.all();
}

// Arrays of mjModel whose change requires mj_setConst(): the first group of its computations that uses one reads it.
std::vector<std::string> setconst_inputs() {
  std::vector<std::string> names;
  const auto add = [&](const char* name, std::initializer_list<int> groups) {
    const auto first = std::ranges::find_if(groups, [](int group) { return group != 0; });
    if (first != groups.end() && (*first & mjSC_IN)) names.emplace_back(name);
  };
#define X(name, fixed, kin0, inert0, spring) add(#name, {fixed, kin0, inert0, spring});
  MJSETCONST_ARRAYS
#undef X
  return names;
}

// Values of mjOption by name, in their order: of flags, the bits.
nb::dict option_words() {
  nb::dict words;
  const auto add = [&](const char* option, const auto& names) {
    nb::list list;
    for (const std::string_view name : names) {
      std::string word;
      for (const char c : name) {
        if (c != ' ') word += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      }
      list.append(word);
    }
    words[option] = nb::tuple(list);
  };
  add("integrator", kEnumNames<mjtIntegrator>);
  add("cone", kEnumNames<mjtCone>);
  add("solver", kEnumNames<mjtSolver>);
  add("jacobian", kEnumNames<mjtJacobian>);
  add("disableflags", std::span<const char* const>(mjDISABLESTRING, mjNDISABLE));
  add("enableflags", std::span<const char* const>(mjENABLESTRING, mjNENABLE));
  return words;
}

// Owns an mjModel or mjData that Python shows.
template <class T, void (*destroy)(T*)>
struct Owned {
  struct Delete {
    void operator()(T* p) const { destroy(p); }
  };
  std::unique_ptr<T, Delete> pointer;
  std::uintptr_t address() const { return reinterpret_cast<std::uintptr_t>(pointer.get()); }
};
using OwnedModel = Owned<mjModel, mj_deleteModel>;
using OwnedData = Owned<mjData, mj_deleteData>;

}  // namespace

void bind_mujoco_views(nb::module_& m) {
  nb::class_<OwnedModel>(m, "OwnedModel", "An mjModel.")
      .def_static("take",
                  [](std::uintptr_t p) {
                    return new OwnedModel{std::unique_ptr<mjModel, OwnedModel::Delete>(
                        reinterpret_cast<mjModel*>(p))};
                  })
      .def_static("copy",
                  [](std::uintptr_t p) {
                    return new OwnedModel{std::unique_ptr<mjModel, OwnedModel::Delete>(
                        call_mujoco(mj_copyModel, nullptr, reinterpret_cast<const mjModel*>(p)))};
                  })
      .def_prop_ro("address", &OwnedModel::address);
  nb::class_<OwnedData>(m, "OwnedData", "An mjData.")
      .def_static("make",
                  [](std::uintptr_t model) {
                    return new OwnedData{std::unique_ptr<mjData, OwnedData::Delete>(
                        call_mujoco(mj_makeData, reinterpret_cast<const mjModel*>(model)))};
                  })
      .def_prop_ro("address", &OwnedData::address);
  m.def("model_fields", &model_fields, nb::arg("model"),
        "Fields of an mjModel: name -> (address, data type, shape).");
  m.def(
      "check_model_indices",
      [](std::uintptr_t model) { check_model_indices(*reinterpret_cast<const mjModel*>(model)); },
      nb::arg("model"),
      "Raises ValueError for an id or address in an mjModel that is out of range.");
  m.def("make_model", &make_model, nb::arg("sizes"),
        "Address of a new mjModel, which the caller owns. Other sizes and all arrays are 0.");
  m.def("data_fields", &data_fields, nb::arg("model"), nb::arg("data"),
        "Fields of an mjData that stay where they are.");
  m.def("arena_fields", &arena_fields, nb::arg("model"), nb::arg("data"),
        "Fields of an mjData that every step moves.");
  m.def("setconst_inputs", &setconst_inputs,
        "Arrays of mjModel whose change requires mj_setConst.");
  m.def("option_words", &option_words,
        "Words of mjOption's enumerations and flags, by the name of the option.");
  m.def("name2id", [](std::uintptr_t model, int kind, const char* name) {
    return mj_name2id(reinterpret_cast<const mjModel*>(model), kind, name);
  });
  m.def("id2name", [](std::uintptr_t model, int kind, int id) {
    const char* name = mj_id2name(reinterpret_cast<const mjModel*>(model), kind, id);
    return std::string(name ? name : "");
  });
  m.def(
      "jac_site",
      [](std::uintptr_t model, std::uintptr_t data,
         nb::ndarray<double, nb::shape<6, -1>, nb::c_contig> jacobian, int site) {
        const auto* from = reinterpret_cast<const mjModel*>(model);
        mj_jacSite(from, reinterpret_cast<const mjData*>(data), jacobian.data(),
                   jacobian.data() + 3 * from->nv, site);
      },
      nb::arg("model"), nb::arg("data"), nb::arg("jacobian"), nb::arg("site"),
      "Writes mj_jacSite into [6, nv].");
  m.def(
      "quat_to_mat",
      [](const std::array<double, 4>& quat) {
        std::array<double, 9> mat;
        mju_quat2Mat(mat.data(), quat.data());
        return mat;
      },
      nb::arg("quat"));
  m.def(
      "mat_to_quat",
      [](const std::array<double, 9>& mat) {
        std::array<double, 4> quat;
        mju_mat2Quat(quat.data(), mat.data());
        return quat;
      },
      nb::arg("mat"));
}

}  // namespace mjsense::python
