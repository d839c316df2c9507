// SPDX-License-Identifier: Apache-2.0
#pragma once
// Shares arrays between C++ and NumPy without copying.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "mjsense/core/array.h"

namespace mjsense::python {

namespace nb = nanobind;

// Type of returned NumPy arrays, so that the signatures of the bindings state it.
class NumpyArray : public nb::object {
  static bool any(PyObject*) { return true; }  // never used to check an argument
  NB_OBJECT(NumpyArray, nb::object, "numpy.ndarray", any)
};

// NumPy array on the view's memory, which `owner` keeps alive.
NumpyArray to_numpy(const ArrayView& view, nb::handle owner);
// The same, but read-only: for measurements of sensors.
NumpyArray to_readonly_numpy(const ArrayView& view, nb::handle owner);

// A Python object that holds `pointer` until it is collected: the owner of arrays that share memory
// with *pointer.
template <class T>
nb::object owner_of(std::shared_ptr<T> pointer) {
  return nb::capsule(new std::shared_ptr<T>(std::move(pointer)),
                     [](void* p) noexcept { delete static_cast<std::shared_ptr<T>*>(p); });
}

}  // namespace mjsense::python
