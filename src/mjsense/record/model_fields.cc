// SPDX-License-Identifier: Apache-2.0
#include "mjsense/record/model_fields.h"

#include <mujoco/mjxmacro.h>

#include <cstring>
#include <limits>
#include <type_traits>

namespace mjsense::record {
namespace {

template <class T>
constexpr DType stored_type() {
  if constexpr (std::is_floating_point_v<T>) {
    return sizeof(T) == 8 ? DType::kFloat64 : DType::kFloat32;
  } else if constexpr (std::is_same_v<T, bool>) {
    return DType::kBool;
  } else {
    static_assert(sizeof(T) == 1 || sizeof(T) == 4 || sizeof(T) == 8);
    return sizeof(T) == 1 ? DType::kUint8 : sizeof(T) == 4 ? DType::kInt32 : DType::kInt64;
  }
}

template <class T>
void add(const char* name, const T* world, const T* scene, std::int64_t rows, std::int64_t columns,
         std::vector<EpisodeArray>& out) {
  const std::size_t bytes = sizeof(T) * static_cast<std::size_t>(rows * columns);
  if (bytes == 0 || world == scene || std::memcmp(world, scene, bytes) == 0) return;
  std::vector<std::byte> values(bytes);
  std::memcpy(values.data(), world, bytes);
  if constexpr (std::is_floating_point_v<T>) {
    constexpr T kSame = std::numeric_limits<T>::quiet_NaN();
    for (std::size_t i = 0; i < bytes / sizeof(T); ++i) {
      if (std::memcmp(world + i, scene + i, sizeof(T)) == 0)
        std::memcpy(values.data() + i * sizeof(T), &kSame, sizeof(T));
    }
  }
  out.push_back({std::string("model/") + name,
                 "Values of this episode's model; NaN: the value of the archived model.", "", "",
                 stored_type<T>(), columns == 1 ? Shape{rows} : Shape{rows, columns},
                 std::move(values)});
}

}  // namespace

std::vector<EpisodeArray> differing_fields(const mjModel& world, const mjModel& scene) {
  std::vector<EpisodeArray> out;
  const mjModel* m = &scene;
  MJMODEL_POINTERS_PREAMBLE(m)
#define X(type, name, rows, columns) add(#name, world.name, m->name, m->rows, columns, out);
  MJMODEL_POINTERS
#undef X
#define X(type, name, size) add("opt." #name, &world.opt.name, &m->opt.name, size, 1, out);
#define XVEC(type, name, size) add("opt." #name, world.opt.name, m->opt.name, size, 1, out);
  MJOPTION_FIELDS
#undef XVEC
#undef X
  return out;
}

}  // namespace mjsense::record
