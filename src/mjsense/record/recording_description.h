// SPDX-License-Identifier: Apache-2.0
#pragma once
// Parser for the JSON text that describes a recording. The text comes from files and is not
// trusted.

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace mjsense::record {

// Returns a discarded value (is_discarded()) if the text is not JSON, is longer than 4 MiB or is
// nested deeper than 64 levels. The depth is limited because later functions recurse once per
// level.
nlohmann::json parse_description(const std::string& text);

}  // namespace mjsense::record
