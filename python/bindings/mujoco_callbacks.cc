// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/mujoco_callbacks.h"

#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>

#include <string>

#include "mjsense/core/error.h"

namespace mjsense::python {

namespace nb = nanobind;

void refuse_python_callbacks() {
  const struct {
    const char* name;
    bool is_set;
  } callbacks[] = {{"mjcb_passive", mjcb_passive != nullptr},
                   {"mjcb_control", mjcb_control != nullptr},
                   {"mjcb_contactfilter", mjcb_contactfilter != nullptr},
                   {"mjcb_sensor", mjcb_sensor != nullptr},
                   {"mjcb_act_dyn", mjcb_act_dyn != nullptr},
                   {"mjcb_act_gain", mjcb_act_gain != nullptr},
                   {"mjcb_act_bias", mjcb_act_bias != nullptr}};
  for (const auto& callback : callbacks) {
    if (!callback.is_set) continue;
    const nb::gil_scoped_acquire lock;
    const nb::object function =
        nb::module_::import_("mujoco").attr((std::string("get_") + callback.name).c_str())();
    // A ctypes function pointer is callable too, but MuJoCo calls it directly.
    const nb::object pointer = nb::module_::import_("ctypes").attr("_CFuncPtr");
    if (!PyCallable_Check(function.ptr()) || nb::isinstance(function, pointer)) continue;
    throw RuntimeError(
        std::string(callback.name) +
        " is a Python function, which MuJoCo cannot call for worlds that are stepped "
        "together: write a mjsense.Sensor or a mjsense.Policy, or set a C function "
        "(ctypes, Numba's cfunc); mujoco.set_" +
        callback.name + "(None) removes it");
  }
}

}  // namespace mjsense::python
