// SPDX-License-Identifier: Apache-2.0
#pragma once
// A named MuJoCo frame (body or site) and its pose.

#include <mujoco/mujoco.h>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::observe {

struct Frame {
  mjtObj type = mjOBJ_UNKNOWN;  // mjOBJ_BODY (the body frame) or mjOBJ_SITE
  int id = -1;

  // `type` is "body" or "site". Throws KeyError with `context` and the nearest names.
  static Frame find(const mjModel* model, std::string_view context, std::string_view type,
                    std::string_view name);
  // X_WF, pose in the world (m).
  Pose pose(const mjData* data) const;
};

// A body given by its full name, or by a function if it can differ between worlds and episodes.
struct BodyRef {
  std::string name;
  std::function<int(int world)> of;  // body id, -1: there is none; used if `name` is empty

  BodyRef(std::string name) : name(std::move(name)) {}
  BodyRef(const char* name) : name(name) {}
  BodyRef(std::function<int(int)> of) : of(std::move(of)) {}
  // Resolves a name to the id for all worlds. Throws KeyError with `context`.
  void resolve(const mjModel* model, std::string_view context);
  int operator()(int world) const { return id_ >= 0 ? id_ : of ? of(world) : -1; }

 private:
  int id_ = -1;
};

// True if `body` is `root` or a descendant of it. Nothing is below a negative id, which means "no
// body".
inline bool is_descendant_or_self(const mjModel* model, int body, int root) {
  if (root < 0) return false;
  // A parent has a smaller id than its children; the world, body 0, is its own parent.
  while (body > root) body = model->body_parentid[body];
  return body == root;
}
}  // namespace mjsense::observe
