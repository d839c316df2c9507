// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/derived_field.h"

#include <mujoco/mjxmacro.h>

#include <algorithm>
#include <cstring>
#include <string_view>
#include <type_traits>

#include "mjsense/core/error.h"

namespace mjsense::python {
namespace {

// An entry of MuJoCo's table of mjData fields.
struct DataField {
  std::string name;
  DType dtype;
  int rows, columns;
  const void* (*pointer)(const mjData*);
};

template <class T>
void add(std::vector<DataField>& fields, const char* name, int rows, int columns,
         const void* (*pointer)(const mjData*)) {
  if constexpr (std::is_same_v<T, mjtNum>)
    fields.push_back({name, DType::kFloat64, rows, columns, pointer});
  if constexpr (std::is_same_v<T, int>)
    fields.push_back({name, DType::kInt32, rows, columns, pointer});
  if constexpr (std::is_same_v<T, mjtBool>)
    fields.push_back({name, DType::kBool, rows, columns, pointer});
}

std::vector<DataField> data_fields(const mjModel* m) {
  std::vector<DataField> fields;
#define X(type, field, nr, nc)                                             \
  add<type>(fields, #field, static_cast<int>(m->nr), static_cast<int>(nc), \
            [](const mjData* d) -> const void* { return d->field; });
#undef MJ_M
#define MJ_M(n) m->n
  MJDATA_POINTERS
#undef MJ_M
#define MJ_M(n) n
#undef X
  return fields;
}

// Fields that MuJoCo computes before accelerations, in the order of mjdata.h. All other fields may
// require all stages.
// clang-format off
constexpr std::string_view kBeforeAccelerations[] = {
    "xpos", "xquat", "xmat", "xipos", "xiquat", "ximat", "xanchor", "xaxis", "geom_xpos",
    "geom_xquat", "geom_xmat", "site_xpos", "site_xquat", "site_xmat", "cam_xpos", "cam_xmat",
    "light_xpos", "light_xdir", "subtree_com", "cdof", "cinert", "flexvert_xpos", "flexelem_aabb",
    "flexedge_length", "ten_J", "ten_length", "actuator_length", "crb", "M", "qLD", "qLDiagInv",
    "ten_velocity", "cvel", "cdof_dot", "actuator_velocity", "qfrc_bias", "qfrc_spring",
    "qfrc_damper", "qfrc_gravcomp", "qfrc_fluid", "qfrc_adhesion", "qfrc_passive",
    "flexedge_velocity"};
// clang-format on

class DerivedField final : public Sensor {
 public:
  explicit DerivedField(DataField field)
      : Sensor("mjData." + field.name), field_(std::move(field)) {}
  std::string_view kind() const override { return "mjdata"; }
  mjtStage needs() const override {
    return std::ranges::count(kBeforeAccelerations, field_.name) ? mjSTAGE_VEL : mjSTAGE_ACC;
  }

  void initialize(const SensorInit& init) override {
    clear_fields();
    SensorSpec spec;
    spec.dtype = field_.dtype;
    spec.shape = field_.columns == 1 ? Shape{field_.rows} : Shape{field_.rows, field_.columns};
    spec.description = "mjData." + field_.name;
    add_field("", spec, init.num_worlds);
  }

  void compute(const World& world) override {
    Array& rows = fields()[0].data;
    if (rows.row_bytes() > 0)
      std::memcpy(rows.row_data(world.id), field_.pointer(world.data), rows.row_bytes());
  }

 private:
  DataField field_;
};

}  // namespace

std::shared_ptr<Sensor> make_derived_field(std::string_view name, const mjModel* model) {
  for (DataField& field : data_fields(model))
    if (field.name == name) return std::make_shared<DerivedField>(std::move(field));
  throw_unknown("simulation", "mjData field", name, derived_field_names(model));
}

std::vector<std::string> derived_field_names(const mjModel* model) {
  std::vector<std::string> names;
  for (DataField& field : data_fields(model)) names.push_back(std::move(field.name));
  return names;
}

}  // namespace mjsense::python
