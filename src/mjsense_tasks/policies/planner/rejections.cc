// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/rejections.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>

#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::policies {

std::string name_of_solid(const mjModel* m, int geom) {
  int body = m->geom_bodyid[geom];
  while (body > 0 && scene::name_of(m, mjOBJ_BODY, body).empty()) body = m->body_parentid[body];
  const std::string name = scene::name_of(m, mjOBJ_GEOM, geom);
  return body == 0 && !name.empty() ? name : scene::name_of(m, mjOBJ_BODY, body);
}

std::string text_of(std::string_view what, const std::vector<Rejection>& rejections,
                    const mjModel* model) {
  struct Reason {
    int count = 0;
    std::map<std::pair<std::string, std::string>, int> bodies;
  };
  std::map<std::string_view, Reason> reasons;
  int tried = 0;
  for (const Rejection& rejection : rejections) {
    if (rejection.reason.empty()) continue;
    ++tried;
    Reason& reason = reasons[rejection.reason];
    ++reason.count;
    const auto [a, b] = rejection.geoms;
    if (a >= 0 && b >= 0) ++reason.bodies[{name_of_solid(model, a), name_of_solid(model, b)}];
  }
  std::vector<std::pair<std::string_view, Reason>> sorted(reasons.begin(), reasons.end());
  std::ranges::stable_sort(sorted, std::ranges::greater(),
                           [](const auto& entry) { return entry.second.count; });
  std::vector<std::string> parts;
  for (const auto& [name, reason] : sorted) {
    std::string part = fmt::format("{} {}", reason.count, name);
    if (!reason.bodies.empty()) {
      const auto& [pair, count] = *std::ranges::max_element(
          reason.bodies, {}, [](const auto& entry) { return entry.second; });
      part += fmt::format(", mostly '{}' with '{}'", pair.first, pair.second);
    }
    parts.push_back(std::move(part));
  }
  return fmt::format("{} {}{}{}", tried, what, parts.empty() ? "" : ": ", fmt::join(parts, "; "));
}

}  // namespace mjsense::tasks::policies
