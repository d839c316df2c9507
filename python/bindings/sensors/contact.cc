// SPDX-License-Identifier: Apache-2.0
// What contact sensors know beyond their rows.

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include "mjsense/sensors/contact/contact_sensor.h"
#include "python/bindings/bindings.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {

namespace nb = nanobind;

void bind_contact(nb::module_& m) {
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
