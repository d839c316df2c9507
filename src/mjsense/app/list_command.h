// SPDX-License-Identifier: Apache-2.0
#pragma once
// `mjsense tasks | robots | scenes`: what there is by name, a line each, with what it needs.

#include <string>

namespace mjsense {

std::string list_tasks(bool json);
std::string list_robots(bool json);
std::string list_scenes(bool json);

}  // namespace mjsense
