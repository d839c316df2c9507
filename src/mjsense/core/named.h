// SPDX-License-Identifier: Apache-2.0
#pragma once
// Lists of things that have names: their names, and the one with a given name.

#include <algorithm>
#include <functional>
#include <ranges>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/error.h"

namespace mjsense {

// `name` is a pointer to a member, or a function of an item.
template <std::ranges::forward_range Items, class Name>
std::vector<std::string> names_of(Items&& items, Name name) {
  std::vector<std::string> names;
  names.reserve(static_cast<std::size_t>(std::ranges::distance(items)));
  for (auto&& item : items) names.emplace_back(std::invoke(name, item));
  return names;
}

// The first item whose name is `wanted`. Throws KeyError as throw_unknown does.
template <std::ranges::forward_range Items, class Name>
std::ranges::range_reference_t<Items> find_named(Items&& items, Name name, std::string_view wanted,
                                                 std::string_view context, std::string_view kind) {
  const auto found = std::ranges::find_if(
      items, [&](const auto& item) { return std::invoke(name, item) == wanted; });
  if (found == std::ranges::end(items)) throw_unknown(context, kind, wanted, names_of(items, name));
  return *found;
}

}  // namespace mjsense
