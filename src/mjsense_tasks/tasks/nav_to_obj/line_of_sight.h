// SPDX-License-Identifier: Apache-2.0
#pragma once
// Visibility of a body in a camera, tested with a few rays to points on its surface. This takes 0.1
// ms; a segmentation image would take several milliseconds. The body is visible if at least one
// point is inside the image and is not occluded by a drawn geom (groups 0 to 2).

#include <mujoco/mujoco.h>

#include <span>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense_tasks/episode/object_shape.h"

namespace mjsense::tasks {

struct LineOfSight {
  int camera = -1;              // id in the model
  double tan_x = 1, tan_y = 1;  // tangents of half the field of view

  LineOfSight() = default;
  // An image of width x height pixels from this camera of the model.
  LineOfSight(const mjModel* model, int camera, int width, int height);
  // X_WC; x points right, y up, and the camera looks along -z.
  Pose pose(const mjData* data) const;
  // `from`: camera pose X_WC, which may differ from the current one. `points`: body frame.
  bool sees(const mjModel* model, const mjData* data, const Pose& from, int body,
            std::span<const Vec3> points) const;
};

// `count` points spread over the surface, body frame. The first one is the center of the shape.
std::vector<Vec3> sight_points(const episode::ObjectShape& shape, int count);

}  // namespace mjsense::tasks
