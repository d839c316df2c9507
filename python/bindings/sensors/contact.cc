// SPDX-License-Identifier: Apache-2.0
// Bindings of contact sensors beyond their rows.

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>

#include <memory>

#include "mjsense/sensors/contact/contact_sensor.h"
#include "python/bindings/bindings.h"
#include "python/bindings/numpy.h"
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
    return tuple_of(h.as<sensors::ContactSensor>().primary_names());
  });
  m.def("contact_secondary_names", [tuple_of](const SensorHandle& h) {
    return tuple_of(h.as<sensors::ContactSensor>().secondary_names());
  });
  m.def(
      "contact_first",
      [](const SensorHandle& h, std::string_view phase, double dt, double abs_tol) {
        const auto& sensor = h.as<sensors::ContactSensor>();
        auto first =
            std::make_shared<Array>(phase == "air" ? sensor.compute_first_air(dt, abs_tol)
                                                   : sensor.compute_first_contact(dt, abs_tol));
        return to_numpy(first->view(), owner_of(first));
      },
      nb::arg("sensor"), nb::arg("phase"), nb::arg("dt"), nb::arg("abs_tol"),
      "bool [B, P]: contact (or air) began less than dt + abs_tol ago.");
}

}  // namespace mjsense::python
