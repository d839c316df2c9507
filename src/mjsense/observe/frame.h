#pragma once
// A named MuJoCo frame - body or site - and its pose.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

struct Frame {
  mjtObj type = mjOBJ_UNKNOWN;  // mjOBJ_BODY (the body frame) or mjOBJ_SITE
  int id = -1;

  // `type` is "body" or "site". Throws KeyError naming `place` and the nearest names.
  static Frame find(const mjModel* model, std::string_view place, std::string_view type,
                    std::string_view name);
  // X_WF: its pose in the world (m).
  Pose pose(const mjData* data) const;
};

// Names of all objects of a type, "" where one has none.
std::vector<std::string> object_names(const mjModel* model, mjtObj type);
// Id of the named object; throws KeyError naming `place` and the nearest names.
int object_id(const mjModel* model, mjtObj type, std::string_view place, std::string_view name);
// 1 for each body that is `root` or below it, else 0; [nbody].
std::vector<char> subtree(const mjModel* model, int root);

}  // namespace mjsense
