#include "python/bindings/reader.h"

#include <typeinfo>

namespace mjsense::python {

std::string config_place(nb::handle config) {
  std::string place = nb::cast<std::string>(config.type().attr("__name__"));
  nb::object name = nb::getattr(config, "name", nb::none());
  if (nb::isinstance<nb::str>(name)) place += " '" + nb::cast<std::string>(name) + "'";
  return place;
}

const char* wanted_of(const std::type_info& type) {
  if (type == typeid(bool)) return "a bool";
  if (type == typeid(std::uint64_t)) return "an int from 0 on";
  if (type == typeid(int) || type == typeid(std::int64_t)) return "an int";
  if (type == typeid(double) || type == typeid(float)) return "a number";
  if (type == typeid(std::string)) return "a str";
  if (type == typeid(std::array<double, 2>)) return "2 numbers";
  if (type == typeid(std::array<double, 3>)) return "3 numbers";
  if (type == typeid(std::array<double, 4>)) return "4 numbers";
  return "of another type";
}

void throw_field_type(nb::handle config, const char* field, nb::handle value, const char* wanted) {
  const std::string text = config_place(config) + ": " + field + " must be " + wanted + ", not " +
                           nb::cast<std::string>(nb::repr(value));
  throw nb::type_error(text.c_str());
}

}  // namespace mjsense::python
