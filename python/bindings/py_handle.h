// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

#include <memory>

namespace mjsense::python {

namespace nb = nanobind;

// A reference to a Python object that any thread may copy and destroy.
class PyHandle {
 public:
  PyHandle() = default;
  explicit PyHandle(nb::object object);
  nb::handle get() const { return object_ ? nb::handle(*object_) : nb::handle(); }
  explicit operator bool() const { return object_ != nullptr; }

 private:
  std::shared_ptr<nb::object> object_;
};

}  // namespace mjsense::python
