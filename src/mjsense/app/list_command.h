// SPDX-License-Identifier: Apache-2.0
#pragma once
// `mjsense tasks | robots | scenes`: lists the available names, one per line, with their
// requirements.

#include <string>

namespace mjsense {

std::string list_tasks(bool json);
std::string list_robots(bool json);
std::string list_scenes(bool json);

}  // namespace mjsense
