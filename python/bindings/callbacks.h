// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace mjsense::python {

// Throws RuntimeError if one of MuJoCo's callbacks (mjcb_sensor and the like) is a Python function:
// the mujoco package can call it only with MjModel and MjData objects made in Python, which the
// worlds of a batch are not. With or without the interpreter's lock; a few loads where no callback
// is set.
void refuse_python_callbacks();

}  // namespace mjsense::python
