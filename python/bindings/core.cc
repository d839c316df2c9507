// SPDX-License-Identifier: Apache-2.0
// Bindings of errors, specs and versions.

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "mjsense/core/error.h"
#include "mjsense/core/files/png.h"
#include "mjsense/core/files/regular_file.h"
#include "mjsense/core/sensor_spec.h"
#include "mjsense/hdf5/lzf.h"
#include "python/bindings/bindings.h"
#include "python/bindings/numpy.h"
#include "python/bindings/python_sensor.h"

namespace mjsense::python {
namespace {

// Translates to mjsense.core.errors.UnknownNameError, a KeyError whose text is printed without quotes.
void translate(const std::exception_ptr& error, void*) {
  try {
    std::rethrow_exception(error);
  } catch (const PythonRowError& e) {
    const nb::handle exception = e.exception.get();
    PyErr_SetObject(reinterpret_cast<PyObject*>(Py_TYPE(exception.ptr())), exception.ptr());
  } catch (const Error& e) {
    const std::string what = printable_lines(e.what());  // names may come from untrusted files
    switch (e.kind()) {
      case ErrorKind::kValue:
        PyErr_SetString(PyExc_ValueError, what.c_str());
        break;
      case ErrorKind::kRuntime:
        PyErr_SetString(PyExc_RuntimeError, what.c_str());
        break;
      case ErrorKind::kKey:
        PyErr_SetString(nb::module_::import_("mjsense.core.errors").attr("UnknownNameError").ptr(),
                        what.c_str());
        break;
    }
  }
}

nb::tuple shape_tuple(const Shape& shape) {
  nb::list dims;
  for (auto dim : shape.dims()) dims.append(dim);
  return nb::tuple(dims);
}

std::string spec_repr(const SensorSpec& s) {
  std::string text =
      "SensorSpec('" + s.name + "', " + std::string(dtype_name(s.dtype)) + s.shape.str();
  if (!s.unit.empty()) text += ", " + s.unit;
  if (!s.frame.empty()) text += ", in " + s.frame;
  return text + ")";
}

}  // namespace

void bind_core(nb::module_& m) {
  nb::register_exception_translator(translate);
  m.attr("__version__") = MJSENSE_VERSION;

  m.def(
      "unknown_name",
      [](const std::string& context, const std::string& kind, const std::string& name,
         const std::vector<std::string>& names) {
        return context + ": no " + kind + " named '" + name + "'" + suggest(name, names);
      },
      nb::arg("place"), nb::arg("kind"), nb::arg("name"), nb::arg("names"),
      "Error text for a name that does not exist, with the nearest names.");

  m.def(
      "lzf_unpack",
      [](nb::bytes packed, std::size_t most) {
        std::vector<std::uint8_t> out(most);
        const auto* data = reinterpret_cast<const std::uint8_t*>(packed.c_str());
        out.resize(hdf5::lzf_unpack({data, packed.size()}, out));
        return nb::bytes(reinterpret_cast<const char*>(out.data()), out.size());
      },
      nb::arg("packed"), nb::arg("most"),
      "Unpacks a chunk of HDF5's filter lzf; no bytes if it is damaged or larger than ``most``.");

  m.def(
      "encode_png",
      [](nb::bytes pixels, int width, int height, int channels, int bits) {
        constexpr int kFastest = 1;
        const auto* data = reinterpret_cast<const std::uint8_t*>(pixels.c_str());
        const auto png = encode_png({data, pixels.size()}, width, height, channels, kFastest, bits);
        return nb::bytes(reinterpret_cast<const char*>(png.data()), png.size());
      },
      nb::arg("pixels"), nb::arg("width"), nb::arg("height"), nb::arg("channels"), nb::arg("bits"),
      "A PNG of dense pixels; those of 16 bits have the high byte first.");

  nb::class_<SensorSpec>(m, "SensorSpec",
                         "Description of a measurement: name, type, shape, unit, frame and range.")
      .def_prop_ro(
          "name", [](const SensorSpec& s) { return s.name; },
          "Full name of the stream: \"feet/force\".")
      .def_prop_ro(
          "dtype", [](const SensorSpec& s) { return std::string(dtype_name(s.dtype)); },
          "NumPy's name of the type.")
      .def_prop_ro(
          "shape", [](const SensorSpec& s) { return shape_tuple(s.shape); },
          "Shape of one world's row.")
      .def_prop_ro(
          "unit", [](const SensorSpec& s) { return s.unit; },
          "\"m\", \"rad\", \"N\" ...; empty: none.")
      .def_prop_ro(
          "frame", [](const SensorSpec& s) { return s.frame; },
          "Frame in which the row is expressed.")
      .def_prop_ro(
          "low", [](const SensorSpec& s) { return s.low; }, "Smallest value that can occur.")
      .def_prop_ro(
          "high", [](const SensorSpec& s) { return s.high; }, "Largest value that can occur.")
      .def_prop_ro(
          "is_dict", [](const SensorSpec& s) { return s.is_dict; },
          "The row is JSON text in uint8.")
      .def_prop_ro(
          "str_max_len", [](const SensorSpec& s) { return s.str_max_len; },
          "Bytes of an is_dict row.")
      .def_prop_ro(
          "description", [](const SensorSpec& s) { return s.description; },
          "One sentence, with the sign.")
      .def("__repr__", &spec_repr);
}

}  // namespace mjsense::python
