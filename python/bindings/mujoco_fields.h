// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where the fields of MuJoCo's structs are, as Python reads them: the array interface of NumPy.

#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

namespace mjsense::python {

namespace nb = nanobind;

// NumPy's data type, as in the array interface.
template <class T>
nb::object numpy_type() {
  if constexpr (std::is_enum_v<T>) {
    return numpy_type<std::underlying_type_t<T>>();
  } else if constexpr (std::is_same_v<T, bool>) {
    return nb::str("|b1");
  } else {
    const char kind = std::is_floating_point_v<T> ? 'f' : std::is_signed_v<T> ? 'i' : 'u';
    return nb::str((std::string("<") + kind + std::to_string(sizeof(T))).c_str());
  }
}

// Name -> (address, data type, shape), or the same of a struct inside. Scalars have the shape (), and
// arrays one dimension if MuJoCo declares the width (the text of the macro's argument) as 1.
class Fields {
 public:
  template <class T>
  void array(const char* name, const T* data, std::int64_t rows, std::int64_t columns,
             std::string_view width) {
    const nb::tuple shape = width == "1" ? nb::make_tuple(rows) : nb::make_tuple(rows, columns);
    set(name, data, numpy_type<T>(), shape);
  }
  template <class T>
  void value(const char* name, const T& field) {
    if constexpr (std::is_array_v<T>) {
      using Element = std::remove_extent_t<T>;
      set(name, field, numpy_type<Element>(), nb::make_tuple(std::extent_v<T>));
    } else {
      set(name, &field, numpy_type<T>(), nb::make_tuple());
    }
  }
  void set(const char* name, const void* data, nb::object type, nb::object shape) {
    all_[name] = nb::make_tuple(reinterpret_cast<std::uintptr_t>(data), type, shape);
  }
  void add(const char* name, const Fields& inner) { all_[name] = inner.all_; }
  nb::dict all() const { return all_; }

 private:
  nb::dict all_;
};

Fields option_fields(const mjOption& opt);
Fields statistic_fields(const mjStatistic& stat);
Fields visual_fields(const mjVisual& vis);

}  // namespace mjsense::python
