// SPDX-License-Identifier: Apache-2.0
#pragma once
// The JSON text that says what a recording is, as it stands in files that anybody may have made.

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace mjsense {

// Discarded (is_discarded()) where it is no JSON text, longer than 4 MiB, or nested more than 64
// times: what is done with it further on calls itself once for each level.
nlohmann::json parse_description(const std::string& text);

}  // namespace mjsense
