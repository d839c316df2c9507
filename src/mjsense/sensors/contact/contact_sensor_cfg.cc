#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/checks.h"
#include "mjsense/core/error.h"
#include "mjsense/sensors/contact/contact_fields.h"
#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense {
namespace {

bool contains(const std::vector<std::string>& list, std::string_view x) {
  return std::find(list.begin(), list.end(), x) != list.end();
}

}  // namespace

void validate(const ContactVizCfg& viz, std::string_view place) {
  require_color(viz.point_color, place, "point_color");
  require_color(viz.force_color, place, "force_color");
  require_not_negative(viz.force_scale, place, "force_scale");
  require_not_negative(viz.point_radius, place, "point_radius");
  require_not_negative(viz.axis_length, place, "axis_length");
  require_not_negative(viz.force_width, place, "force_width");
}

std::unique_ptr<Sensor> ContactSensorCfg::build() const {
  const std::string place = sensor_place(name);
  validate_primary(primary, place + ": primary");
  if (fields.empty()) throw ValueError(fmt::format("{}: no fields are asked for", place));
  for (std::size_t i = 0; i < fields.size(); ++i) {
    if (!contains(contact_fields(), fields[i]))
      throw_unknown(place, "field", fields[i], contact_fields());
    if (std::count(fields.begin(), fields.end(), fields[i]) > 1) {
      throw ValueError(fmt::format("{}: field '{}' is asked for twice", place, fields[i]));
    }
  }
  const ContactReduce how = contact_reduce_from_name(reduce, place);
  if (num_slots < 1) {
    throw ValueError(fmt::format("{}: num_slots is {}: must be at least 1", place, num_slots));
  }
  if (history_length > 65535) {
    throw ValueError(fmt::format("{}: history_length is {}: at most 65535", place, history_length));
  }
  const std::vector<std::string> policies = {"first", "any", "error", "each"};
  if (!contains(policies, secondary_policy)) {
    throw ValueError(fmt::format("{}: secondary_policy '{}'{}", place, secondary_policy,
                                 suggest(secondary_policy, policies)));
  }
  if (secondary) validate_secondary(*secondary, secondary_policy, place + ": secondary");
  if (secondary_policy == "each" && !secondary) {
    throw ValueError(fmt::format("{}: secondary_policy 'each' needs a secondary", place));
  }
  if (global_frame && how != ContactReduce::kNetForce &&
      !(contains(fields, "normal") && contains(fields, "tangent"))) {
    throw ValueError(
        fmt::format("{}: global_frame needs 'normal' and 'tangent' among fields", place));
  }
  validate(viz, place);
  return std::make_unique<ContactSensor>(*this);
}

}  // namespace mjsense
