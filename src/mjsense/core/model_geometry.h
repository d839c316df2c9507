// SPDX-License-Identifier: Apache-2.0
#pragma once
// Poses and boxes of the elements of a MuJoCo model.

#include <mujoco/mujoco.h>

#include <array>

#include "mjsense/core/aabb.h"
#include "mjsense/core/pose.h"

namespace mjsense {

// In the world, at the state of `data`.
inline Pose body_pose(const mjData* data, int body) {
  return {vec3(data->xpos + 3 * body), quat(data->xquat + 4 * body)};
}
inline Pose geom_pose(const mjData* data, int geom) {
  return pose_from_mat(data->geom_xpos + 3 * geom, data->geom_xmat + 9 * geom);
}
inline Pose site_pose(const mjData* data, int site) {
  return pose_from_mat(data->site_xpos + 3 * site, data->site_xmat + 9 * site);
}
inline Pose camera_pose(const mjData* data, int camera) {
  return pose_from_mat(data->cam_xpos + 3 * camera, data->cam_xmat + 9 * camera);
}

// In the frame of the parent body or of the geom's body, with all joints at their reference
// positions.
inline Pose body_frame(const mjModel* model, int body) {
  return {vec3(model->body_pos + 3 * body), quat(model->body_quat + 4 * body)};
}
inline Pose geom_frame(const mjModel* model, int geom) {
  return {vec3(model->geom_pos + 3 * geom), quat(model->geom_quat + 4 * geom)};
}
// `pose`, which is in the frame of `body`, in the frame of its ancestor `root` (0: the world), with
// all joints at their reference positions.
inline Pose in_ancestor(const mjModel* model, Pose pose, int body, int root = 0) {
  for (; body != root; body = model->body_parentid[body]) pose = body_frame(model, body) * pose;
  return pose;
}

// Corners of the box around a geom, in the geom's frame.
inline std::array<Vec3, 8> geom_corners(const mjModel* model, int geom) {
  const double* box = model->geom_aabb + 6 * geom;
  return box_corners(vec3(box), vec3(box + 3));
}

// Whether a geom can be in contact with others.
inline bool is_solid(const mjModel* model, int geom) {
  return model->geom_contype[geom] != 0 || model->geom_conaffinity[geom] != 0;
}

// Position of a body with a free joint in qpos.
inline int free_qpos(const mjModel* model, int body) {
  return model->jnt_qposadr[model->body_jntadr[body]];
}

}  // namespace mjsense
