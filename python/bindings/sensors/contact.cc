// ContactSensorCfg in Python, and what contact sensors know beyond their rows.

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include "mjsense/sensors/contact/contact_sensor.h"
#include "python/bindings/bindings.h"
#include "python/bindings/configs.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {

template <class Fields>
void fields(Fields& f, ContactMatch& c) {
  f("mode", c.mode);
  f("pattern", c.pattern);
  f("entity", c.entity);
  f("exclude", c.exclude);
}

template <class Fields>
void fields(Fields& f, ContactVizCfg& c) {
  f("show_points", c.show_points);
  f("show_frames", c.show_frames);
  f("show_forces", c.show_forces);
  f("force_scale", c.force_scale);
  f("point_color", c.point_color);
  f("force_color", c.force_color);
  f("point_radius", c.point_radius);
  f("axis_length", c.axis_length);
  f("force_width", c.force_width);
}

template <class Fields>
void fields(Fields& f, ContactSensorCfg& c) {
  f("name", c.name);
  f("primary", c.primary);
  f("secondary", c.secondary);
  f("secondary_policy", c.secondary_policy);
  f("fields", c.fields);
  f("reduce", c.reduce);
  f("num_slots", c.num_slots);
  f("global_frame", c.global_frame);
  f("track_air_time", c.track_air_time);
  f("history_length", c.history_length);
  f("track_events", c.track_events);
  f("latch", c.latch);
  f("friction_split", c.friction_split);
  f("other_ids", c.other_ids);
  f("debug", c.debug);
  f("debug_vis", c.debug_vis);
  f("viz", c.viz);
}

CfgKind contact_kind() { return cfg_kind<ContactSensorCfg>("contact"); }

void bind_contact(nb::module_& m) {
  add_cfg_check<ContactMatch>("ContactMatch");
  add_cfg_check<ContactVizCfg>("ContactVizCfg");
  const auto tuple_of = [](const std::vector<std::string>& names) {
    nb::list list;
    for (const std::string& name : names) list.append(name);
    return nb::tuple(list);
  };
  m.def("contact_primary_names", [tuple_of](const SensorHandle& h) {
    return tuple_of(h.as<ContactSensor>().primary_names());
  });
  m.def("contact_secondary_names", [tuple_of](const SensorHandle& h) {
    return tuple_of(h.as<ContactSensor>().secondary_names());
  });
}

}  // namespace mjsense::python
