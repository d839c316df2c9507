// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/cameras/visibility.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/observe/frame.h"

namespace mjsense::tasks::cameras {
namespace {

constexpr double kMaxRays = 16384;
constexpr std::uint32_t kDrawn = 0b111;  // groups 0 to 2

}  // namespace

std::vector<double> visible_shares(const rays::RayScene& rays, int world, const CameraView& from,
                                   std::span<const int> bodies) {
  const mjModel* m = rays.model();
  rays::RayFilter filter;
  filter.groups = kDrawn;
  filter.backfaces = rays::RayFilter::Backfaces::kCull;
  rays::RayScratch scratch(rays.num_objects());

  const double per_ray = std::max(1.0, std::sqrt(from.width * from.height / kMaxRays));
  const int columns = std::max(1, static_cast<int>(from.width / per_ray));
  const int rows = std::max(1, static_cast<int>(from.height / per_ray));
  const double focal =
      0.5 * from.height / std::tan(0.5 * from.fovy * std::numbers::pi / 180);  // pixels

  std::vector<std::int64_t> seen(m->ngeom, 0);
  rays::RayPacket packet{};
  write_vec(from.camera.p, packet.origin);
  rays::HitPacket hits;
  for (int row = 0; row < rows; ++row) {
    const double y = 0.5 * from.height - (row + 0.5) * from.height / rows;
    for (int first = 0; first < columns; first += rays::kPacket) {
      for (int k = 0; k < rays::kPacket; ++k) {
        const double x = (first + k + 0.5) * from.width / columns - 0.5 * from.width;
        const Vec3 d = rotate(from.camera.q, normalized(Vec3{x, y, -focal}));
        for (int i = 0; i < 3; ++i) packet.d[i][k] = static_cast<float>(d[i]);
        packet.tmax[k] = first + k < columns ? rays::kNoHit : -1.0f;
      }
      rays.trace(world, filter, packet, hits, scratch);
      for (int k = 0; k < rays::kPacket; ++k) {
        if (hits.geom[k] >= 0 && hits.geom[k] < m->ngeom) ++seen[hits.geom[k]];
      }
    }
  }
  std::vector<double> shares;
  for (int body : bodies) {
    std::int64_t count = 0;
    for (int g = 0; g < m->ngeom; ++g) {
      if (seen[g] > 0 && observe::is_descendant_or_self(m, m->geom_bodyid[g], body))
        count += seen[g];
    }
    shares.push_back(static_cast<double>(count) / (static_cast<double>(rows) * columns));
  }
  return shares;
}

bool is_inside(const rays::RayScene& rays, int world, const Pose& camera) {
  rays::RayFilter filter;
  filter.groups = kDrawn;
  double eye[3], up[3];
  write_vec(camera.p, eye);
  write_vec(rotate(camera.q, {0, 1, 0}), up);
  const rays::Hit hit = rays.trace(world, filter, eye, up);
  return hit.geom >= 0 && hit.normal[0] * up[0] + hit.normal[1] * up[1] + hit.normal[2] * up[2] > 0;
}

}  // namespace mjsense::tasks::cameras
