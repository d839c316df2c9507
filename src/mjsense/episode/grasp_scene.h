// SPDX-License-Identifier: Apache-2.0
#pragma once
// What a planner of grasps asks of a task, whichever it is: the objects within reach, which of them
// is meant, and what they stand on.

#include <span>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/episode/object_shape.h"

namespace mjsense {

struct GraspObject {
  int body = -1;
  std::string kind;   // "mug": of models/objects
  ObjectShape shape;  // in the size of its model
};

// Where a task wants its target put.
class PlaceScene {
 public:
  virtual ~PlaceScene() = default;
  // Body on, in or beside which it is to come to rest.
  virtual int receptacle(int world) const = 0;
  // Where the middle of its underside may be (m, world), best first, as the world stands, with the object turned by
  // `turn` from how it is now; `out` is empty. None where it has no place.
  virtual void places(const World& world, const Quat& turn, std::vector<Vec3>& out) const = 0;
};

class GraspScene {
 public:
  virtual ~GraspScene() = default;
  virtual std::span<const GraspObject> all_objects() const = 0;  // target and distractors
  // In the size that the object has in this world's episode. It lives as long as the task: what is known of a shape may
  // be kept by its address.
  virtual const ObjectShape& shape(int /*world*/, int object) const {
    return all_objects()[object].shape;
  }
  virtual int target(int world) const = 0;  // index in all_objects()
  virtual double support_height(
      int world) const = 0;  // m, of what the target stands on at the start
  // Null: it is only to be picked up.
  virtual const PlaceScene* place_scene() const { return nullptr; }
};

}  // namespace mjsense
