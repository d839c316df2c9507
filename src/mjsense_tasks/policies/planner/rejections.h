// SPDX-License-Identifier: Apache-2.0
#pragma once
// Reasons why candidates of a plan were rejected, for the message of a planner that found no plan.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mjsense::tasks::policies {

struct Rejection {
  std::string_view reason;            // e.g. "out of reach"; "": the candidate was not tried
  std::pair<int, int> geoms{-1, -1};  // in collision; -1: none

  static Rejection collision(std::pair<int, int> geoms) { return {"in collision", geoms}; }
};

// Name of a geom's body or its nearest named ancestor; name of the geom if it belongs to the world
// body.
std::string name_of_solid(const mjModel* model, int geom);

// "256 grasps: 200 out of reach; 40 in collision, mostly 'link5' with 'shelf/board'". `what` names
// the candidates. Collisions name bodies, since geoms often have no name.
std::string text_of(std::string_view what, const std::vector<Rejection>& rejections,
                    const mjModel* model);

}  // namespace mjsense::tasks::policies
