// SPDX-License-Identifier: Apache-2.0
#pragma once
// Interface between tasks and grasp planners: the objects within reach, the target among them, and
// the surface that supports it.

#include <span>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense_tasks/episode/object_shape.h"

namespace mjsense::tasks::episode {

struct GraspObject {
  int body = -1;
  std::string kind;   // kind in models/objects, such as "mug"
  ObjectShape shape;  // at the size of its model
};

// Where a task requires its target to be placed.
class PlaceScene {
 public:
  virtual ~PlaceScene() = default;
  // The body on, in or next to which the target must come to rest.
  virtual int receptacle(int world) const = 0;
  // Possible positions (m, world frame) of the centre of the target's underside in the current
  // state, best first, if the object is rotated by `turn` from its current orientation. `out` is
  // empty when called, and stays empty if there is no such position.
  virtual void places(const World& world, const Quat& turn, std::vector<Vec3>& out) const = 0;
};

class GraspScene {
 public:
  virtual ~GraspScene() = default;
  virtual std::span<const GraspObject> all_objects() const = 0;  // target and distractors
  // Shape of the object at its size in this world's episode. The reference is valid as long as the
  // task, so that its address can be the key of a cache.
  virtual const ObjectShape& shape(int /*world*/, int object) const {
    return all_objects()[object].shape;
  }
  virtual int target(int world) const = 0;  // index in all_objects()
  // Height of the surface that supports the target at the start, m.
  virtual double support_height(int world) const = 0;
  // Null if the target only has to be picked up.
  virtual const PlaceScene* place_scene() const { return nullptr; }
};

}  // namespace mjsense::tasks::episode
