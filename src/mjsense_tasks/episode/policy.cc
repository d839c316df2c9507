// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/episode/policy.h"

#include <fmt/format.h>

#include "mjsense/core/error.h"

namespace mjsense::tasks::episode {

void Policy::act(const World& /*world*/, robots::Action& /*action*/) {
  throw ValueError(fmt::format("policy '{}' acts for all worlds at once: call act_all()", name()));
}

void Policy::reset_all(ActiveWorlds& worlds) {
  worlds.for_each([this](const World& world) { reset(world); });
}

void Policy::act_all(ActiveWorlds& worlds, std::span<robots::Action> actions) {
  worlds.for_each([this, all = actions.data()](const World& world) { act(world, all[world.id]); });
}

}  // namespace mjsense::tasks::episode
