// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads a scene that was configured in Python.

#include <nanobind/nanobind.h>

#include "mjsense/scene/scene.h"

namespace mjsense::python {

namespace nb = nanobind;

// `spec` is the empty MjSpec in which the scene is built, so that Python's spec_fn receives the
// actual object. `edit` is called without arguments after everything is attached. Both, and the
// objects added to `alive`, must live until the Scene is constructed.
scene::SceneCfg read_scene(nb::handle config, nb::handle spec, nb::list sensors, nb::handle edit,
                           nb::list& alive);

}  // namespace mjsense::python
