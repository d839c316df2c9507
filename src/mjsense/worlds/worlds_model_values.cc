// SPDX-License-Identifier: Apache-2.0
#include <mujoco/mjxmacro.h>

#include <cstring>

#include "mjsense/worlds/worlds.h"

namespace mjsense::worlds {
namespace {

// Writes the values that this world has in a field of its own, if it has any.
void write_row(mjBatch* batch, int world, const char* field, void* to) {
  int size = 0, element = 0;
  const auto* rows = static_cast<const char*>(mjb_expanded(batch, field, &size, &element));
  if (rows == nullptr) return;
  const std::size_t bytes = static_cast<std::size_t>(size) * element;
  std::memcpy(to, rows + bytes * world, bytes);
}

void write_options(mjBatch* batch, int world, mjOption& options) {
#define X(type, name, size) write_row(batch, world, "opt." #name, &options.name);
#define XVEC X
  MJOPTION_FIELDS
#undef XVEC
#undef X
}

}  // namespace

mjModel Worlds::model_of(int world) const {
  mjModel mine = *model();
  int size = 0;
#define X(type, name, nr, nc)                                         \
  if (const void* rows = mjb_expanded(batch_, #name, &size, nullptr)) \
    mine.name = static_cast<type*>(const_cast<void*>(rows)) + std::ptrdiff_t{size} * world;
  MJMODEL_POINTERS
#undef X
  write_options(batch_, world, mine.opt);
  return mine;
}

void Worlds::write_model(int world, mjModel* copy) const {
#define X(type, name, nr, nc) write_row(batch_, world, #name, copy->name);
  MJMODEL_POINTERS
#undef X
  write_options(batch_, world, copy->opt);
}

}  // namespace mjsense::worlds
