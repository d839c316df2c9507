#pragma once
// Flexes of one world: triangles whose vertices move, a BVH each, refitted by every update.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/rays/shared_geometry.h"

namespace mjsense {

class FlexShapes {
 public:
  FlexShapes() = default;
  // `vertices` [nflexvert, 3] stay where they are, with room for a fourth coordinate of the last.
  FlexShapes(RTCDevice device, const mjModel* model, std::span<const float> vertices);

  // The vertices have moved. Embree may allocate.
  void update();
  const void* const* scenes() const {
    return pointers_.data();
  }  // RTCScene by flex id; null for lines

 private:
  std::vector<SceneHandle> scenes_;
  std::vector<const void*> pointers_;
};

}  // namespace mjsense
