// SPDX-License-Identifier: Apache-2.0
#pragma once
// Arrays cross the language border without a copy.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "mjsense/core/array.h"

namespace mjsense::python {

namespace nb = nanobind;

// A Python object that is one: so signatures say what comes back.
class NumpyArray : public nb::object {
  static bool any(PyObject*) { return true; }  // none is ever taken as an argument
  NB_OBJECT(NumpyArray, nb::object, "numpy.ndarray", any)
};

// A NumPy array on the view's memory, which `owner` keeps alive.
NumpyArray to_numpy(const ArrayView& view, nb::handle owner);
// One that NumPy refuses to write: what a sensor measured.
NumpyArray to_readonly_numpy(const ArrayView& view, nb::handle owner);

// A Python object that holds `pointer` until it is collected: the owner of arrays on memory inside
// *pointer.
template <class T>
nb::object owner_of(std::shared_ptr<T> pointer) {
  return nb::capsule(new std::shared_ptr<T>(std::move(pointer)),
                     [](void* p) noexcept { delete static_cast<std::shared_ptr<T>*>(p); });
}

}  // namespace mjsense::python
