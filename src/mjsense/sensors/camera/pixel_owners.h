// SPDX-License-Identifier: Apache-2.0
#pragma once
// The body and the entity of the object that a pixel shows.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/render/view/image_targets.h"

namespace mjsense::sensors {

// The body of an object in the segmentation; -1: there is no object, or it has many bodies (flexes,
// skins, tendons).
int body_of(const mjModel* model, int object, int id);

class PixelOwners {
 public:
  PixelOwners(const SensorInit& init, int width, int height);

  // Adds a buffer of this thread for ids, if `targets` lacks one.
  void complete(render::ImageTargets& targets, int thread);
  // Writes pixels [begin, end) of the images [H, W]; a null image is not written. A body is -1
  // where body_of() is -1; an entity is -1 for objects that belong to no entity.
  void write(const render::ImageTargets& image, int begin, int end, std::int32_t* bodies,
             std::int32_t* entities) const;

 private:
  const mjModel* model_;
  // Index in Scene::entities(), or -1.
  std::vector<std::int32_t> geom_entity_, flex_entity_, skin_entity_, site_entity_, tendon_entity_;
  std::vector<std::vector<std::int32_t>> scratch_;  // [threads], [H, W, 2]
};

}  // namespace mjsense::sensors
