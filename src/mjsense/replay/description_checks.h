// SPDX-License-Identifier: Apache-2.0
#pragma once
// Checks of the JSON text that describes a recording, and of what it says the file contains.

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace mjsense::replay {

// A stream that the description lists, as recorded or as carried over by a rendering, and the paths
// in a trajectory where it may be: a camera's image is a video, or an array.
struct ListedStream {
  std::string name;
  std::vector<std::string> places;
};
[[nodiscard]] std::vector<ListedStream> listed_places(const nlohmann::json& description);

// Faults of the values that readers use, one sentence each: "whose fps is \"1/0\", ...".
[[nodiscard]] std::vector<std::string> description_faults(const nlohmann::json& description);

}  // namespace mjsense::replay
