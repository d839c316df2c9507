// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a planner of grasps asks of a task, whichever it is: the objects within reach, which of them
// is meant, and what they stand on.

#include <span>
#include <string>

#include "mjsense/episode/object_shape.h"

namespace mjsense {

struct GraspObject {
  int body = -1;
  std::string kind;  // "mug": of models/objects
  ObjectShape shape;
};

class GraspScene {
 public:
  virtual ~GraspScene() = default;
  virtual std::span<const GraspObject> all_objects() const = 0;  // target and distractors
  virtual int target(int world) const = 0;                       // index in all_objects()
  virtual double support_height(
      int world) const = 0;  // m, of what the target stands on at the start
};

}  // namespace mjsense
