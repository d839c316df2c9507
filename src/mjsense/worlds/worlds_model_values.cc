// SPDX-License-Identifier: Apache-2.0
#include <mujoco/mjxmacro.h>

#include <cstring>

#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {

mjModel Worlds::model_of(int world) const {
  mjModel mine = *model();
  int size = 0;
#define X(type, name, nr, nc)                                         \
  if (const void* rows = mjb_expanded(batch_, #name, &size, nullptr)) \
    mine.name = static_cast<type*>(const_cast<void*>(rows)) + std::ptrdiff_t{size} * world;
  MJMODEL_POINTERS
#undef X
  return mine;
}

void Worlds::write_model(int world, mjModel* copy) const {
  const auto write = [&](const char* field, void* to) {
    int size = 0, element = 0;
    const auto* rows = static_cast<const char*>(mjb_expanded(batch_, field, &size, &element));
    if (rows == nullptr) return;
    const std::size_t bytes = static_cast<std::size_t>(size) * element;
    std::memcpy(to, rows + bytes * world, bytes);
  };
#define X(type, name, nr, nc) write(#name, copy->name);
  MJMODEL_POINTERS
#undef X
#define X(type, name, size) write("opt." #name, &copy->opt.name);
#define XVEC X
  MJOPTION_FIELDS
#undef XVEC
#undef X
}

}  // namespace mjsense::worlds
