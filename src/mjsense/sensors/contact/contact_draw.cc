// SPDX-License-Identifier: Apache-2.0
// Debug drawing of a contact sensor: the contacts in its slots.

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/debug_shapes.h"
#include "mjsense/sensors/contact/contact_pass.h"
#include "mjsense/sensors/contact/contact_reading.h"
#include "mjsense/sensors/contact/contact_sensor.h"

namespace mjsense::sensors {

void ContactSensor::draw(const World& world, DebugShapes& shapes) {
  pass_->run(world);  // slots refer to the contacts of the current moment
  const ContactVizCfg& viz = cfg_.viz;
  const double unit = shapes.meansize();
  const double scale = viz.force_scale > 0 ? viz.force_scale : world.model->vis.map.force;
  for (int p = 0; p < reducer_.num_primaries(); ++p) {
    const int count = reducer_.count(world.id, p);
    const int filled = reducer_.is_net() ? std::min(count, 1) : std::min(count, cfg_.num_slots);
    for (int k = 0; k < filled; ++k) {
      const ContactReading reading =
          reducer_.is_net() ? read_net_contact(world, reducer_.sum(world.id, p))
                            : read_contact(world, reducer_.slot(world.id, p, k), true, true);
      const std::string label = fmt::format("{}_{}_{}", name(), primary_names_[p], k);
      const Vec3 at = vec3(reading.pos), force = vec3(reading.force);
      if (viz.show_points) shapes.add_sphere(at, viz.point_radius * unit, viz.point_color, label);
      if (viz.show_frames && !reducer_.is_net()) {  // a sum has no frame
        const Vec3 x = vec3(reading.normal), y = vec3(reading.tangent), z = cross(x, y);
        const double mat[9] = {x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z};
        shapes.add_frame(at, mat, viz.axis_length * unit, 0.1 * unit, label);
      }
      // The arrow ends at the contact point. If it started there, it would be inside the other
      // object.
      if (viz.show_forces && norm(force) > 0)
        shapes.add_arrow(at - scale * force, at, viz.force_width * unit, viz.force_color,
                         label + "_force");
    }
  }
}

}  // namespace mjsense::sensors
