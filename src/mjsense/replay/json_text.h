// SPDX-License-Identifier: Apache-2.0
#pragma once
// Parser for the JSON rows of dict sensors. Accepts what Python's json.loads does, including NaN
// and Infinity.

#include <functional>
#include <string>
#include <string_view>

namespace mjsense::replay {

// Called for every number (true and false count as 1 and 0). `path` holds the keys of the enclosing
// objects, joined by '/'. The elements of a list have the path of the list.
using OnNumber = std::function<void(const std::string& path, double value)>;

// Returns "" if `text` is one JSON value, otherwise the error and its position: "byte 17: expected
// ',' or '}'".
std::string parse_json(std::string_view text, const OnNumber& on_number = nullptr);

// Removes the padding of a row.
std::string_view trim_row(std::string_view row);

}  // namespace mjsense::replay
