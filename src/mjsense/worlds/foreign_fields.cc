// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/foreign_fields.h"

#include <mujoco/mjxmacro.h>

#include <bit>
#include <cstring>
#include <type_traits>

namespace mjsense::worlds {
namespace {

template <class T>
constexpr DType type_of() {
  if constexpr (std::is_same_v<T, mjtNum>) return DType::kFloat64;
  if constexpr (std::is_same_v<T, float>) return DType::kFloat32;
  if constexpr (std::is_same_v<T, int>) return DType::kInt32;
  if constexpr (std::is_same_v<T, mjtBool>) return DType::kBool;
  return DType::kUint8;
}

template <class To, class From>
void convert(const void* from, void* to, std::int64_t n) {
  const auto* source = static_cast<const From*>(from);
  auto* target = static_cast<To*>(to);
  for (std::int64_t i = 0; i < n; ++i) target[i] = static_cast<To>(source[i]);
}

template <class T>
bool same_bits(T a, T b) {
  if constexpr (std::is_same_v<T, float>) {
    return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
  } else {
    return a == b;
  }
}

template <class To, class From>
void take_changed(const void* now, const void* seen, void* to, std::int64_t n) {
  const auto* source = static_cast<const From*>(now);
  const auto* old = static_cast<const From*>(seen);
  auto* target = static_cast<To*>(to);
  for (std::int64_t i = 0; i < n; ++i) {
    if (!same_bits(source[i], old[i])) target[i] = static_cast<To>(source[i]);
  }
}

}  // namespace

std::optional<DataField> data_field(const mjModel* m, std::string_view field) {
#define FIELD(T, name, n, constraints, expression)                            \
  if (field == #name)                                                         \
    return DataField{type_of<T>(), static_cast<std::int64_t>(n), constraints, \
                     [](const mjData* d) -> const void* { return expression; }};
#define X(T, name, nr, nc) FIELD(T, name, m->nr*(nc), false, d->name)
#undef MJ_M
#define MJ_M(n) m->n
  MJDATA_POINTERS
#undef MJ_M
#define MJ_M(n) n
#undef X
  FIELD(mjtNum, time, 1, false, &d->time)
  FIELD(mjtNum, energy, 2, false, d->energy)
#define X(name) FIELD(int, name, 1, false, &d->name)
  X(ne)
  X(nf)
  X(nl)
  X(nefc)
#undef X
#define X(T, name) FIELD(T, efc_##name, 1, true, d->efc_##name)
  X(int, type)
  X(int, id)
  X(int, state)
  X(mjtNum, pos)
  X(mjtNum, margin)
  X(mjtNum, D)
  X(mjtNum, vel)
  X(mjtNum, aref)
  X(mjtNum, frictionloss)
  X(mjtNum, force)
#undef X
#undef FIELD
  return std::nullopt;
}

std::optional<ModelFieldType> model_field(const mjModel* m, std::string_view field) {
  MJMODEL_POINTERS_PREAMBLE(m)
#define X(T, name, nr, nc) \
  if (field == #name) return ModelFieldType{type_of<T>(), static_cast<std::int64_t>(m->nr) * (nc)};
  MJMODEL_POINTERS
#undef X
#define X(T, name, n) \
  if (field == "opt." #name) return ModelFieldType{type_of<T>(), n};
#define XVEC X
  MJOPTION_FIELDS
#undef XVEC
#undef X
  return std::nullopt;
}

const void* model_values(const mjModel& m, std::string_view field) {
#define X(T, name, nr, nc) \
  if (field == #name) return m.name;
  MJMODEL_POINTERS
#undef X
#define X(T, name, n) \
  if (field == "opt." #name) return &m.opt.name;
#define XVEC X
  MJOPTION_FIELDS
#undef XVEC
#undef X
  return nullptr;
}

SetConst set_const_use(std::string_view field) {
#define X(name, fixed, kin0, inert0, spring)                \
  if (field == #name) {                                     \
    int first = 0, all = 0;                                 \
    for (int group : {fixed, kin0, inert0, spring}) {       \
      if (first == 0) first = group;                        \
      all |= group;                                         \
    }                                                       \
    return {(first & mjSC_IN) != 0, (all & mjSC_OUT) != 0}; \
  }
  MJSETCONST_ARRAYS
#undef X
  return {};
}

bool converts(DType ours, DType theirs) {
  if (theirs == DType::kFloat32) return ours == DType::kFloat64 || ours == DType::kFloat32;
  if (theirs == DType::kBool) return ours == DType::kBool || ours == DType::kUint8;
  return theirs == DType::kInt32 && ours != DType::kFloat64 && ours != DType::kFloat32;
}

void show_elements(const void* from, DType type, void* to, DType theirs, std::int64_t n) {
  if (type == DType::kFloat64) return convert<float, double>(from, to, n);
  if (theirs == DType::kInt32 && type != DType::kInt32)
    return convert<int, std::uint8_t>(from, to, n);
  std::memcpy(to, from, n * dtype_size(theirs));
}

void take_elements(const void* now, const void* seen, DType theirs, void* to, DType type,
                   std::int64_t n) {
  if (type == DType::kFloat64) return take_changed<double, float>(now, seen, to, n);
  if (type == DType::kFloat32) return take_changed<float, float>(now, seen, to, n);
  if (type == DType::kInt32) return take_changed<int, int>(now, seen, to, n);
  if (theirs == DType::kInt32) return take_changed<std::uint8_t, int>(now, seen, to, n);
  take_changed<std::uint8_t, std::uint8_t>(now, seen, to, n);
}

}  // namespace mjsense::worlds
