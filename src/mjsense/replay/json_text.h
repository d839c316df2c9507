// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reading the JSON rows of dict sensors: as Python's json.loads accepts them, with NaN and
// Infinity.

#include <functional>
#include <string>
#include <string_view>

namespace mjsense {

// Called for every number (true and false count as 1 and 0); `path` is the keys on the way, joined
// by '/'. The elements of a list share the path of the list.
using OnNumber = std::function<void(const std::string& path, double value)>;

// "" if `text` is one JSON value, else what is wrong and where: "byte 17: expected ',' or '}'".
std::string parse_json(std::string_view text, const OnNumber& on_number = nullptr);

// A row without its padding.
std::string_view trim_row(std::string_view row);

}  // namespace mjsense
