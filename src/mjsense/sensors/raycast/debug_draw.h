#pragma once
// What a ray sensor saw, as geoms for MuJoCo's viewers: a ball at each hit and, as cfg().viz asks,
// an arrow along each ray and the surface's normal.

#include <mujoco/mujoco.h>

#include "mjsense/sensors/raycast/raycast.h"

namespace mjsense {

// Appends to `scene` the last reading of this world. Returns how many geoms found no room.
// Labels: "<sensor>_hit_3", "<sensor>_ray_3", "<sensor>_normal_3".
int draw_rays(const RayCastSensor& sensor, int world, const mjModel* model, mjvScene* scene);

}  // namespace mjsense
