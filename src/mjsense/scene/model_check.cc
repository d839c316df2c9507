// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/model_check.h"

#include <fmt/format.h>
#include <mujoco/mjxmacro.h>

#include <cmath>
#include <string_view>
#include <type_traits>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::scene {
namespace {

constexpr double kLongestTimestep = 0.1;  // s; a longer one gives a warning

template <class T>
void check_field(const mjModel* m, mjtObj type, std::string_view field, const T* values,
                 std::int64_t rows, std::int64_t columns) {
  if constexpr (std::is_floating_point_v<T>) {
    if (field.ends_with("_user")) return;
    const bool place = field.ends_with("_pos") || field.ends_with("_quat");
    for (std::int64_t i = 0; i < rows * columns; ++i) {
      if (place ? std::isfinite(values[i]) : !std::isnan(values[i])) continue;
      const int id = static_cast<int>(i / columns);
      const char* name = mj_id2name(m, type, id);
      throw ValueError(
          fmt::format("scene: {} of {} {} is {}: must be finite", field, obj_type_name(type),
                      name ? fmt::format("'{}'", name) : fmt::format("{}", id), values[i]));
    }
  }
}

}  // namespace

void check_model(const mjModel* m, std::vector<std::string>& warnings) {
  const double timestep = m->opt.timestep;
  if (!(timestep > 0 && std::isfinite(timestep)))
    throw ValueError(
        fmt::format("scene: timestep is {}: must be a positive number of seconds", timestep));
  if (timestep > kLongestTimestep)
    warnings.push_back(
        fmt::format("scene: a timestep of {} s is long: contacts need 0.001 to 0.02 s, and the "
                    "motion is unreliable with longer steps",
                    timestep));
  mjtObj type = mjOBJ_BODY;
#define X(T, field, nr, nc) check_field(m, type, #field, m->field, m->nr, nc);
#undef MJ_M
#define MJ_M(n) m->n
  MJMODEL_POINTERS_BODY
  type = mjOBJ_JOINT;
  MJMODEL_POINTERS_JOINT
  type = mjOBJ_GEOM;
  MJMODEL_POINTERS_GEOM
  type = mjOBJ_SITE;
  MJMODEL_POINTERS_SITE
  type = mjOBJ_CAMERA;
  MJMODEL_POINTERS_CAMERA
  type = mjOBJ_LIGHT;
  MJMODEL_POINTERS_LIGHT
  type = mjOBJ_EQUALITY;
  MJMODEL_POINTERS_EQUALITY
  type = mjOBJ_TENDON;
  MJMODEL_POINTERS_TENDON
  type = mjOBJ_ACTUATOR;
  MJMODEL_POINTERS_ACTUATOR
#undef MJ_M
#define MJ_M(n) n
#undef X
}

}  // namespace mjsense::scene
