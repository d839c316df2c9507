// SPDX-License-Identifier: Apache-2.0
#pragma once
// To which body and which entity the object that a pixel sees belongs.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/render/view/view.h"

namespace mjsense {

// The body that carries an object of segmentation; -1: nothing is there, or many carry it (flexes,
// skins, tendons).
int body_of(const mjModel* model, int object, int id);

class PixelOwners {
 public:
  PixelOwners(const SensorInit& init, int width, int height);

  // A buffer of this thread for ids, if `targets` lacks them.
  void complete(ImageTargets& targets, int thread);
  // Pixels [begin, end) of the images [H, W]; null: not wanted. -1 where body_of()
  // is, and for what no entity brought in.
  void write(const ImageTargets& image, int begin, int end, std::int32_t* bodies,
             std::int32_t* entities) const;

 private:
  const mjModel* model_;
  // Index in Scene::entities(), or -1.
  std::vector<std::int32_t> geom_entity_, flex_entity_, skin_entity_, site_entity_, tendon_entity_;
  std::vector<std::vector<std::int32_t>> scratch_;  // [threads], [H, W, 2]
};

}  // namespace mjsense
