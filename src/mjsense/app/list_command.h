// SPDX-License-Identifier: Apache-2.0
#pragma once
// `mjsense tasks | robots | scenes | objects`: lists the available names with their requirements.

#include <string>

namespace mjsense::app {

std::string list_tasks(bool json);
std::string list_robots(bool json);
std::string list_scenes(bool json);
std::string list_objects(bool json);

}  // namespace mjsense::app
