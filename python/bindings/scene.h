// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reads a scene that Python configured.

#include <nanobind/nanobind.h>

#include "mjsense/scene/scene.h"

namespace mjsense::python {

namespace nb = nanobind;

// `spec` is the empty MjSpec that the scene is built in, so that Python's spec_fn sees the real
// thing; `edit` is called with no argument when everything is attached. Both, and what is added to
// `alive`, must live until the Scene is made.
SceneCfg read_scene(nb::handle config, nb::handle spec, nb::list sensors, nb::handle edit,
                    nb::list& alive);

}  // namespace mjsense::python
