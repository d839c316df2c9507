// SPDX-License-Identifier: Apache-2.0
#pragma once
// Surroundings that are only seen: a model without joints whose geoms take part in no contact.

#include <string>
#include <string_view>

#include "mjsense/scene/entity.h"

namespace mjsense::scene {

// Name of the entity that a backdrop is.
inline constexpr std::string_view kBackdrop = "backdrop";
inline bool is_of_backdrop(std::string_view full_name) {
  return full_name.starts_with(kBackdrop) && full_name.substr(kBackdrop.size()).starts_with('/');
}

// A function that converts a file of another format and returns the path of the MJCF file; the Python
// package sets one. Throws ValueError that names the file.
using BackdropConverter = std::string (*)(const std::string& path);
void set_backdrop_converter(BackdropConverter converter);

// The backdrop in an MJCF file, or in a file that is converted. Its geoms of the groups 3 to 5, which
// cameras do not show, are left out. Throws ValueError that names the file.
EntityCfg backdrop_entity(const std::string& path);

}  // namespace mjsense::scene
