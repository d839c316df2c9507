// SPDX-License-Identifier: Apache-2.0
#pragma once
// Whether a camera sees a body, by a few rays to its surface: a tenth of a millisecond where a
// segmentation image would cost several. It sees it where one of these points lies in the picture and nothing that is
// drawn (groups 0 to 2) stands before it.

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/episode/object_shape.h"

namespace mjsense {

struct Sight {
  int camera = -1;              // of the model
  double tan_x = 1, tan_y = 1;  // of half the picture's angles

  Sight() = default;
  // A picture of width:height through this camera of the model.
  Sight(const mjModel* model, int camera, int width, int height);
  // X_WC: x to the right, y up, looking along -z.
  Pose pose(const mjData* data) const;
  // `from`: where the camera stands, not necessarily where it is now.
  bool sees(const mjModel* model, const mjData* data, const Pose& from, int body,
            std::span<const Vec3> points) const;
};

// So many points of a surface, body frame, spread over it; its middle is the first.
std::vector<Vec3> sight_points(const ObjectShape& shape, int count);

}  // namespace mjsense
