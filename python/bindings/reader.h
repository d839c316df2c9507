#pragma once
// Reads the attributes of a Python configuration object into a C++ one. Every config has one
// function that lists its fields; it serves both directions (reading a config, and telling Python
// the C++ defaults, which a test compares with Python's):
//
//   template <class Fields> void fields(Fields& f, BuiltinSensorCfg& c) {
//     f("name", c.name);
//     f("sensor_type", c.sensor_type);
//   }

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <string>
#include <type_traits>

namespace mjsense::python {

namespace nb = nanobind;

template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};
template <class T>
struct IsVector : std::false_type {};
template <class T>
struct IsVector<std::vector<T>> : std::true_type {};

// "ContactSensorCfg 'feet'"
std::string config_place(nb::handle config);
// TypeError "ContactSensorCfg 'feet': num_slots must be an int, not 'two'"
[[noreturn]] void throw_field_type(nb::handle config, const char* field, nb::handle value,
                                   const char* wanted);
const char* wanted_of(const std::type_info& type);

// Values with fields of their own (ObjRef, ContactMatch ...) are read by their fields(...); what
// needs more than that, by a read_custom(FromPython&, nb::handle, T&), both declared in this
// namespace.
class FromPython {
 public:
  explicit FromPython(nb::handle config) : config_(config) {}
  // Of a value inside another config, which error messages name.
  FromPython(nb::handle config, nb::handle parent, const char* field)
      : config_(config), parent_(parent), field_(field) {}

  template <class T>
  void operator()(const char* name, T& out) {
    if (!nb::hasattr(config_, name)) throw_no_field(name);
    nb::object value = nb::getattr(config_, name);
    read(name, value, out);
  }

  nb::handle config() const { return config_; }

  template <class T>
  void read(const char* name, nb::handle value, T& out) {
    if constexpr (requires { fields(*this, out); }) {
      if (value.is_none()) {
        out = T{};
        return;
      }
      FromPython nested(value, config_, name);
      fields(nested, out);
    } else if constexpr (requires { read_custom(*this, value, out); }) {
      read_custom(*this, value, out);
    } else if constexpr (IsOptional<T>::value) {
      if (value.is_none()) return out.reset();
      read(name, value, out.emplace());
    } else if constexpr (IsVector<T>::value) {
      out.clear();
      if (nb::isinstance<nb::str>(value) || !nb::hasattr(value, "__iter__")) {
        // One element stands for a list of one: pattern="a", frame=ObjRef(...).
        if (value.is_none()) return;
        read(name, value, out.emplace_back());
        return;
      }
      for (nb::handle item : value) read(name, item, out.emplace_back());
    } else if (std::is_same_v<T, std::string> && value.is_none()) {
      out = T{};
    } else {
      if (std::is_arithmetic_v<T> && (nb::isinstance<nb::bool_>(value) != std::is_same_v<T, bool>))
        throw_field_type(config_, name, value, wanted_of(typeid(T)));
      if (!nb::try_cast<T>(value, out))
        throw_field_type(config_, name, value, wanted_of(typeid(T)));
    }
  }

 private:
  [[noreturn]] void throw_no_field(const char* name) const {
    const std::string wanted = std::string("a configuration with '") + name + "'";
    if (parent_) throw_field_type(parent_, field_, config_, wanted.c_str());
    throw_field_type(config_, "it", config_, wanted.c_str());
  }

  nb::handle config_, parent_;
  const char* field_ = "";
};

// The other direction: a dict of the fields' values.
class ToPython {
 public:
  template <class T>
  void operator()(const char* name, T& value) {
    values[name] = write(value);
  }
  nb::dict values;

 private:
  template <class T>
  nb::object write(T& value) {
    if constexpr (requires(ToPython & f) { fields(f, value); }) {
      ToPython nested;
      fields(nested, value);
      return nested.values;
    } else if constexpr (requires(FromPython & f, nb::handle h) { read_custom(f, h, value); }) {
      return nb::none();
    } else if constexpr (IsOptional<T>::value) {
      if (!value) return nb::none();
      return write(*value);
    } else if constexpr (IsVector<T>::value) {
      nb::list list;
      for (auto& item : value) list.append(write(item));
      return nb::tuple(list);
    } else {
      return nb::cast(value);
    }
  }
};

}  // namespace mjsense::python
