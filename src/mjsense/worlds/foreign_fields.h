// SPDX-License-Identifier: Apache-2.0
#pragma once
// The fields of mjData and mjModel by name, and copies between them and arrays of another program.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <optional>
#include <string_view>

#include "mjsense/core/array.h"

namespace mjsense::worlds {

// A field of mjData. Of the constraints' fields, `count` is that of one constraint.
struct DataField {
  DType type;
  std::int64_t count;
  bool constraints;
  const void* (*pointer)(const mjData*);
};

std::optional<DataField> data_field(const mjModel* m, std::string_view field);

// A field of mjModel, or an option, for example opt.gravity.
struct ModelFieldType {
  DType type;
  std::int64_t count;
};
std::optional<ModelFieldType> model_field(const mjModel* m, std::string_view field);
// Its elements in a model; null if there is no such field.
const void* model_values(const mjModel& m, std::string_view field);

// How mj_setConst() uses a field of the model.
struct SetConst {
  bool in = false, out = false;
};
SetConst set_const_use(std::string_view field);

// Whether a field of MuJoCo can be shown in, and taken from, an array of this type.
bool converts(DType ours, DType theirs);
// Copies `n` elements of MuJoCo's `type` to the program's.
void show_elements(const void* from, DType type, void* to, DType theirs, std::int64_t n);
// Copies those of the program's elements that differ from `seen`.
void take_elements(const void* now, const void* seen, DType theirs, void* to, DType type,
                   std::int64_t n);

}  // namespace mjsense::worlds
