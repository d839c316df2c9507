// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/contact/contact_fields.h"

#include <cstddef>
#include <utility>

namespace mjsense::sensors {

std::string contact_field_frame(std::string_view field, bool world_axes) {
  if (field.starts_with("pos") || field.starts_with("normal") || field.starts_with("tangent"))
    return field == "normal_force" ? contact_field_frame("force", world_axes) : "world";
  if (field.find("force") == field.npos && field.find("torque") == field.npos) return "";
  return world_axes ? "world" : "contact";
}

namespace {

constexpr int index_of(std::size_t byte_offset) {
  return static_cast<int>(byte_offset / sizeof(double));
}

}  // namespace

int contact_field_offset(std::string_view field) {
  if (field == "force") return index_of(offsetof(ContactReading, force));
  if (field == "torque") return index_of(offsetof(ContactReading, torque));
  if (field == "dist") return index_of(offsetof(ContactReading, dist));
  if (field == "pos") return index_of(offsetof(ContactReading, pos));
  if (field == "normal") return index_of(offsetof(ContactReading, normal));
  if (field == "tangent") return index_of(offsetof(ContactReading, tangent));
  if (field == "normal_force") return index_of(offsetof(ContactReading, normal_force));
  if (field == "friction_force") return index_of(offsetof(ContactReading, friction_force));
  return -1;
}

}  // namespace mjsense::sensors
