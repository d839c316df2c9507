// SPDX-License-Identifier: Apache-2.0
#pragma once
// Why each candidate of a plan was refused, for the message of a planner that found none.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mjsense {

struct Refusal {
  std::string_view reason;            // "out of reach"; "": the candidate was not tried
  std::pair<int, int> geoms{-1, -1};  // that collided; -1: none did

  static Refusal collision(std::pair<int, int> geoms) { return {"in collision", geoms}; }
};

// "256 grasps: 200 out of reach; 40 in collision, mostly 'link5' with 'shelf/board'". `what` names
// the candidates. Bodies are named, since geoms often have no name; of the world geoms are.
std::string text_of(std::string_view what, const std::vector<Refusal>& refusals,
                    const mjModel* model);

}  // namespace mjsense
