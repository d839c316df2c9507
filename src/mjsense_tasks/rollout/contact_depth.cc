// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/contact_depth.h"

#include <fmt/format.h>

#include "mjsense_tasks/policies/planner/rejections.h"

namespace mjsense::tasks::rollout {

void ContactDepth::observe(const World& world) {
  Episode& episode = episodes_[world.id];
  const int step = episode.step++;
  for (int i = 0; i < world.data->ncon; ++i) {
    const mjContact& contact = world.data->contact[i];
    const double depth = -contact.dist;
    // Contacts of flexes have no geom: a deformable body is soft.
    if (depth <= limit_ || contact.exclude != 0 || contact.geom[0] < 0 || contact.geom[1] < 0)
      continue;
    const std::pair geoms(contact.geom[0], contact.geom[1]);
    if (step == 0) {
      episode.start.insert(geoms);
    } else if (!episode.start.contains(geoms) &&
               (!episode.deepest || depth > episode.deepest->depth)) {
      episode.deepest = {depth, step, geoms};
    }
  }
}

std::string ContactDepth::description(int world, const mjModel* model) const {
  const std::optional<Deepest>& deepest = episodes_[world].deepest;
  if (!deepest) return "";
  return fmt::format("{:.1f} mm in step {}: '{}' and '{}'; max_penetration is {:g} mm",
                     1000 * deepest->depth, deepest->step,
                     policies::name_of_solid(model, deepest->geoms.first),
                     policies::name_of_solid(model, deepest->geoms.second), 1000 * limit_);
}

}  // namespace mjsense::tasks::rollout
