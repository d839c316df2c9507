// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/scene_camera.h"

#include <cmath>

#include "mjsense/core/error.h"

namespace mjsense::render {
namespace {

// Sets the pose between the two cameras. Returns false if they have no direction.
bool set_pose(const AbstractCamera& left, const AbstractCamera& right, SceneCamera& out) {
  double ahead[3], up[3], along = 0, forward_length = 0, up_length = 0;
  for (int k = 0; k < 3; ++k) {
    out.position[k] = 0.5 * (static_cast<double>(left.pos[k]) + right.pos[k]);
    ahead[k] = static_cast<double>(left.forward[k]) + right.forward[k];
    up[k] = static_cast<double>(left.up[k]) + right.up[k];
    forward_length += ahead[k] * ahead[k];
  }
  for (double& x : ahead) x /= std::sqrt(forward_length);
  for (int k = 0; k < 3; ++k) along += up[k] * ahead[k];
  for (int k = 0; k < 3; ++k) {
    up[k] -= along * ahead[k];
    up_length += up[k] * up[k];
  }
  for (double& x : up) x /= std::sqrt(up_length);
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    out.rotation[3 * k] = ahead[i] * up[j] - ahead[j] * up[i];
    out.rotation[3 * k + 1] = up[k];
    out.rotation[3 * k + 2] = -ahead[k];
  }
  return forward_length > 0 && up_length > 0;
}

}  // namespace

SceneCamera read_camera(const StructReader& reader, const SceneMemory& scene, int width,
                        int height) {
  AbstractCamera left, right;
  reader.read(scene.cameras[0], left);
  reader.read(scene.cameras[1], right);
  const auto mean = [&](auto member) { return 0.5f * (left.*member + right.*member); };
  const float near = mean(&AbstractCamera::frustum_near), far = mean(&AbstractCamera::frustum_far);
  const float center = mean(&AbstractCamera::frustum_center),
              bottom = mean(&AbstractCamera::frustum_bottom),
              top = mean(&AbstractCamera::frustum_top);
  float half = mean(&AbstractCamera::frustum_width);
  const float frustum[] = {near, center, bottom, top, half};
  for (const AbstractCamera& camera : {left, right})
    if (!is_finite(camera.pos) || !is_finite(camera.forward) || !is_finite(camera.up) ||
        !is_finite(frustum))
      throw ValueError("the scene's camera has a pose or field of view that is not finite");
  SceneCamera out;
  if (!set_pose(left, right, out) || !(near > 0))
    throw ValueError("the scene's camera has no direction or near plane");
  if (half == 0)
    half = 0.5f * static_cast<float>(width) / static_cast<float>(height) * (top - bottom);
  out.near = near;
  out.far = far;
  PixelGrid& grid = out.grid;
  grid.orthographic = left.orthographic != 0;
  const float scale = grid.orthographic ? 1 : 1 / near;
  grid.width = width;
  grid.height = height;
  grid.left = (center - half) * scale;
  grid.top = top * scale;
  grid.dx = 2 * half * scale / static_cast<float>(width);
  grid.dy = -(top - bottom) * scale / static_cast<float>(height);
  return out;
}

}  // namespace mjsense::render
