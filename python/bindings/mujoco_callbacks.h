// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace mjsense::python {

// Throws RuntimeError if one of MuJoCo's callbacks (mjcb_sensor and the like) is a Python function.
// The mujoco package can call it only with MjModel and MjData objects created in Python, which the
// worlds of a batch are not. May be called with or without the GIL; costs a few loads if no
// callback is set.
void refuse_python_callbacks();

}  // namespace mjsense::python
