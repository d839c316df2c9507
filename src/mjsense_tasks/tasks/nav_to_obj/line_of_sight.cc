// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/nav_to_obj/line_of_sight.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/model_geometry.h"
#include "mjsense/observe/frame.h"

namespace mjsense::tasks {

LineOfSight::LineOfSight(const mjModel* model, int camera, int width, int height) : camera(camera) {
  tan_y = std::tan(0.5 * model->cam_fovy[camera] * std::numbers::pi / 180);
  tan_x = tan_y * width / height;
}

Pose LineOfSight::pose(const mjData* data) const { return camera_pose(data, camera); }

bool LineOfSight::sees(const mjModel* m, const mjData* d, const Pose& from, int body,
                       std::span<const Vec3> points) const {
  const Pose object = body_pose(d, body);
  const Pose to_camera = inverse(from);
  constexpr mjtByte kDrawn[mjNGROUP] = {1, 1, 1, 0, 0, 0};
  double eye[3];
  write_vec(from.p, eye);
  for (Vec3 point : points) {
    const Vec3 p = object * point, c = to_camera * p;
    if (c.z >= 0 || std::abs(c.x) > -c.z * tan_x || std::abs(c.y) > -c.z * tan_y) continue;
    double path[3];
    write_vec(p - from.p, path);
    int geom = -1;
    mj_ray(m, d, eye, path, kDrawn, 1, m->cam_bodyid[camera], &geom, nullptr);
    if (geom >= 0 && observe::is_descendant_or_self(m, m->geom_bodyid[geom], body)) return true;
  }
  return false;
}

std::vector<Vec3> sight_points(const episode::ObjectShape& shape, int count) {
  std::vector<Vec3> points{{0, 0, 0.5 * (shape.low + shape.high)}};
  // Farthest point sampling: each point is the farthest from all previous ones.
  std::vector<double> nearest(shape.points.size(), 1e10);
  while (static_cast<int>(points.size()) < count && points.size() <= shape.points.size()) {
    std::size_t far = 0;
    for (std::size_t i = 0; i < shape.points.size(); ++i) {
      nearest[i] = std::min(nearest[i], norm(shape.points[i] - points.back()));
      if (nearest[i] > nearest[far]) far = i;
    }
    // Move the point inwards, because a ray to the silhouette may miss the body.
    points.push_back(0.97 * shape.points[far] + 0.03 * points[0]);
  }
  return points;
}

}  // namespace mjsense::tasks
