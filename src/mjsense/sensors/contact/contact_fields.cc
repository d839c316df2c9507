#include "mjsense/sensors/contact/contact_fields.h"

#include <cstddef>
#include <utility>

#include "mjsense/core/error.h"

namespace mjsense {

const std::vector<std::string>& contact_fields() {
  static const std::vector<std::string> kFields = {"found", "force",  "torque", "dist",
                                                   "pos",   "normal", "tangent"};
  return kFields;
}

SensorSpec contact_spec(Shape shape, DType dtype, std::string unit, std::string frame,
                        std::string description) {
  SensorSpec spec;
  spec.dtype = dtype;
  spec.shape = shape;
  spec.unit = std::move(unit);
  spec.frame = std::move(frame);
  spec.description = std::move(description);
  return spec;
}

SensorSpec contact_field_spec(std::string_view field, bool world_axes) {
  const std::string axes = world_axes ? "world" : "contact";
  SensorSpec s;
  if (field == "found") {
    s = contact_spec({}, DType::kFloat32, "", "",
                     "Number of matching contacts, 0 in an empty slot.");
    s.low = 0.0;
  } else if (field == "force") {
    s = contact_spec({3}, DType::kFloat32, "N", axes, "Force of the primary on the other side.");
  } else if (field == "torque") {
    s = contact_spec({3}, DType::kFloat32, "N m", axes, "Torque of the primary on the other side.");
  } else if (field == "dist") {
    s = contact_spec({}, DType::kFloat32, "m", "", "Signed distance, negative in penetration.");
  } else if (field == "pos") {
    s = contact_spec({3}, DType::kFloat32, "m", "world", "Contact point.");
  } else if (field == "normal") {
    s = contact_spec({3}, DType::kFloat32, "", "world", "Unit normal, from the primary outwards.");
  } else if (field == "tangent") {
    s = contact_spec({3}, DType::kFloat32, "", "world",
                     "Unit vector of the contact frame's y axis.");
  } else {
    throw_unknown("contact sensor", "field", field, contact_fields());
  }
  return s;
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

}  // namespace mjsense
