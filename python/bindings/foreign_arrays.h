// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

namespace mjsense::python {

void bind_foreign_arrays(nanobind::module_& m);

}  // namespace mjsense::python
