// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/occupancy_grid.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr int kRound = 16;  // corners of a circle's polygon

// Points (world frame) whose hull contains a geom.
std::vector<Vec3> points_of(const mjModel* m, const mjData* d, int g) {
  const Pose pose = geom_pose(d, g);
  const double* size = m->geom_size + 3 * g;
  std::vector<Vec3> points;
  const auto rings = [&](double rx, double ry, double half, double cap) {
    // the polygon must contain the circle
    const double out = 1 / std::cos(std::numbers::pi / kRound);
    for (int i = 0; i < kRound; ++i) {
      const double a = 2 * std::numbers::pi * i / kRound, x = out * rx * std::cos(a),
                   y = out * ry * std::sin(a);
      for (const double z : {-half, half}) points.push_back(pose * Vec3{x, y, z});
      if (cap > 0) {
        for (const double s : {-1.0, 1.0})
          points.push_back(pose * Vec3{0.7 * x, 0.7 * y, s * (half + 0.75 * cap)});
      }
    }
    for (const double s : {-1.0, 1.0}) points.push_back(pose * Vec3{0, 0, s * (half + cap)});
  };
  switch (m->geom_type[g]) {
    case mjGEOM_SPHERE:
      rings(size[0], size[0], 0, size[0]);
      break;
    case mjGEOM_ELLIPSOID:
      rings(size[0], size[1], 0, size[2]);
      break;
    case mjGEOM_CAPSULE:
      rings(size[0], size[0], size[1], size[0]);
      break;
    case mjGEOM_CYLINDER:
      rings(size[0], size[0], size[1], 0);
      break;
    case mjGEOM_MESH: {
      const int mesh = m->geom_dataid[g];
      const float* vertices = m->mesh_vert + 3 * static_cast<std::ptrdiff_t>(m->mesh_vertadr[mesh]);
      for (int i = 0; i < m->mesh_vertnum[mesh]; ++i)
        points.push_back(pose * Vec3{vertices[3 * i], vertices[3 * i + 1], vertices[3 * i + 2]});
      break;
    }
    default:
      for (Vec3 corner : geom_corners(m, g)) points.push_back(pose * corner);
  }
  return points;
}

// Triangles (vertex indices) of a mesh's convex hull, or of the mesh itself if it has no hull.
// Empty: not a mesh.
std::span<const int> triangles_of(const mjModel* m, int g) {
  if (m->geom_type[g] != mjGEOM_MESH) return {};
  const int mesh = m->geom_dataid[g];
  if (m->mesh_graphadr[mesh] < 0) {
    return {m->mesh_face + 3 * static_cast<std::ptrdiff_t>(m->mesh_faceadr[mesh]),
            3 * static_cast<std::size_t>(m->mesh_facenum[mesh])};
  }
  // mjModel.mesh_graph: numvert, numface, 2 numbers per vertex, edges, vertices of the faces.
  const int* graph = m->mesh_graph + m->mesh_graphadr[mesh];
  const std::size_t points = graph[0], faces = graph[1];
  return {graph + 2 + 2 * points + (points + 3 * faces), 3 * faces};
}

// Corners of the part of the hull of `points` between two heights: the points within, and the
// intersections of the hull's edges with both heights. Without triangles, every pair of points is
// taken for an edge.
std::vector<Vec3> between(const std::vector<Vec3>& points, std::span<const int> triangles,
                          double low, double high) {
  std::vector<Vec3> out;
  const auto cross = [&](Vec3 a, Vec3 b) {
    for (const double z : {low, high}) {
      if ((a.z < z) != (b.z < z)) out.push_back(a + ((z - a.z) / (b.z - a.z)) * (b - a));
    }
  };
  for (Vec3 p : points) {
    if (p.z >= low && p.z <= high) out.push_back(p);
  }
  for (std::size_t i = 0; i < triangles.size(); i += 3) {
    for (std::size_t k = 0; k < 3; ++k)
      cross(points[triangles[i + k]], points[triangles[i + (k + 1) % 3]]);
  }
  if (!triangles.empty()) return out;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::size_t k = i + 1; k < points.size(); ++k) cross(points[i], points[k]);
  }
  return out;
}

// Convex hull in the xy plane, corners in order (Andrew's monotone chain).
std::vector<Vec3> hull(std::vector<Vec3> p) {
  std::ranges::sort(p, [](Vec3 a, Vec3 b) { return a.x < b.x || (a.x == b.x && a.y < b.y); });
  std::vector<Vec3> h(2 * p.size() + 1);
  const auto turn = [](Vec3 o, Vec3 a, Vec3 b) {
    return (a.x - o.x) * (b.y - o.y) - (a.y - o.y) * (b.x - o.x);
  };
  std::size_t k = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    while (k >= 2 && turn(h[k - 2], h[k - 1], p[i]) <= 0) --k;
    h[k++] = p[i];
  }
  for (std::size_t i = p.size(), minimum = k + 1; i-- > 1;) {
    while (k >= minimum && turn(h[k - 2], h[k - 1], p[i - 1]) <= 0) --k;
    h[k++] = p[i - 1];
  }
  h.resize(k > 1 ? k - 1 : k);
  return h;
}

// Squared distance transform along one line (Felzenszwalb and Huttenlocher, "Distance transforms of
// sampled functions", 2012).
void transform(std::vector<double>& f, std::vector<double>& d, std::vector<int>& v,
               std::vector<double>& z) {
  const int n = static_cast<int>(f.size());
  int k = 0;
  v[0] = 0;
  z[0] = -1e20;
  z[1] = 1e20;
  for (int q = 1; q < n; ++q) {
    const auto cross = [&](int i) {
      return ((f[q] + static_cast<double>(q) * q) - (f[i] + static_cast<double>(i) * i)) /
             (2.0 * (q - i));
    };
    double s = cross(v[k]);
    while (s <= z[k]) s = cross(v[--k]);
    v[++k] = q;
    z[k] = s;
    z[k + 1] = 1e20;
  }
  k = 0;
  for (int q = 0; q < n; ++q) {
    while (z[k + 1] < q) ++k;
    d[q] = static_cast<double>(q - v[k]) * (q - v[k]) + f[v[k]];
  }
}

}  // namespace

OccupancyGrid::OccupancyGrid(const mjModel* m, const mjData* d,
                             const std::function<bool(int)>& counts, const OccupancyCfg& cfg)
    : cell_(cfg.cell) {
  std::vector<std::vector<Vec3>> outlines;
  double low[2] = {1e10, 1e10}, high[2] = {-1e10, -1e10};
  for (int g = 0; g < m->ngeom; ++g) {
    if (!is_solid(m, g) || m->geom_type[g] == mjGEOM_PLANE || !counts(g)) continue;
    const Vec3 at = vec3(d->geom_xpos + 3 * g);
    if (std::abs(at.x) > 0.5 * cfg.max_extent || std::abs(at.y) > 0.5 * cfg.max_extent) continue;
    const std::vector<Vec3> here = points_of(m, d, g);
    std::vector<Pose> moves = cfg.elsewhere ? cfg.elsewhere(g) : std::vector<Pose>{};
    if (moves.empty()) moves.emplace_back();
    std::vector<Vec3> outline;
    for (const Pose& move : moves) {
      std::vector<Vec3> points;
      double bottom = 1e10, top = -1e10;
      for (Vec3 p : here) {
        points.push_back(move * p);
        bottom = std::min(bottom, points.back().z);
        top = std::max(top, points.back().z);
        // Floors extend the grid too.
        for (int i = 0; i < 2; ++i) {
          low[i] = std::max(std::min(low[i], points.back()[i]), -0.5 * cfg.max_extent);
          high[i] = std::min(std::max(high[i], points.back()[i]), 0.5 * cfg.max_extent);
        }
      }
      if (bottom > cfg.high || top < cfg.low) continue;
      const std::vector<Vec3> part = between(points, triangles_of(m, g), cfg.low, cfg.high);
      outline.insert(outline.end(), part.begin(), part.end());
    }
    if (!outline.empty()) outlines.push_back(hull(std::move(outline)));
  }
  if (low[0] > high[0]) throw ValueError("occupancy: the model has no collision geom");
  x0_ = low[0] - cfg.margin;
  y0_ = low[1] - cfg.margin;
  columns_ = std::max(1, static_cast<int>(std::ceil((high[0] + cfg.margin - x0_) / cell_)));
  rows_ = std::max(1, static_cast<int>(std::ceil((high[1] + cfg.margin - y0_) / cell_)));
  taken_.assign(static_cast<std::size_t>(columns_) * rows_, 0);
  for (const auto& outline : outlines) fill(outline);
  measure();
}

// Marks the cells whose squares the polygon touches, approximated as a distance from the cell
// centre below half a cell.
void OccupancyGrid::fill(std::span<const Vec3> p) {
  const Aabb box = aabb_of(p);
  const double half = 0.5 * cell_;
  const int c0 = std::max(0, static_cast<int>((box.low.x - x0_) / cell_ - 1)),
            c1 = std::min(columns_ - 1, static_cast<int>((box.high.x - x0_) / cell_ + 1));
  const int r0 = std::max(0, static_cast<int>((box.low.y - y0_) / cell_ - 1)),
            r1 = std::min(rows_ - 1, static_cast<int>((box.high.y - y0_) / cell_ + 1));
  for (int row = r0; row <= r1; ++row) {
    for (int column = c0; column <= c1; ++column) {
      const double px = x(column), py = y(row);
      bool inside = p.size() > 2;
      double nearest = 1e10;
      for (std::size_t i = 0; i < p.size(); ++i) {
        const Vec3 a = p[i], b = p[(i + 1) % p.size()];
        const double ex = b.x - a.x, ey = b.y - a.y, length = ex * ex + ey * ey;
        const double t =
            length > 0 ? std::clamp(((px - a.x) * ex + (py - a.y) * ey) / length, 0.0, 1.0) : 0.0;
        nearest = std::min(nearest, std::hypot(px - a.x - t * ex, py - a.y - t * ey));
        if (ex * (py - a.y) - ey * (px - a.x) < 0) inside = false;
      }
      if (inside || nearest <= half) taken_[index(column, row)] = 1;
    }
  }
}

void OccupancyGrid::measure() {
  const int longest = std::max(columns_, rows_);
  std::vector<double> squared(taken_.size()), f, out(longest), z(longest + 1);
  std::vector<int> v(longest);
  for (std::size_t i = 0; i < taken_.size(); ++i) squared[i] = taken_[i] ? 0 : 1e12;
  f.resize(rows_);
  for (int c = 0; c < columns_; ++c) {
    for (int r = 0; r < rows_; ++r) f[r] = squared[index(c, r)];
    transform(f, out, v, z);
    for (int r = 0; r < rows_; ++r) squared[index(c, r)] = out[r];
  }
  f.resize(columns_);
  distance_.resize(taken_.size());
  for (int r = 0; r < rows_; ++r) {
    for (int c = 0; c < columns_; ++c) f[c] = squared[index(c, r)];
    transform(f, out, v, z);
    for (int c = 0; c < columns_; ++c)
      distance_[index(c, r)] = static_cast<float>(cell_ * std::sqrt(out[c]));
  }
}

double OccupancyGrid::clearance(double px, double py) const {
  const int column = static_cast<int>(std::floor((px - x0_) / cell_)),
            row = static_cast<int>(std::floor((py - y0_) / cell_));
  if (column < 0 || row < 0 || column >= columns_ || row >= rows_) return 0;
  return std::max(0.0, static_cast<double>(distance_[index(column, row)]) - 0.5 * cell_);
}

Footprint::Footprint(const mjModel* m, const mjData* d, const std::function<bool(int)>& counts,
                     const Pose& base, double high) {
  const Pose to_base = inverse(base);
  for (int g = 0; g < m->ngeom; ++g) {
    if (!is_solid(m, g) || !counts(g)) continue;
    std::vector<Vec3> points = points_of(m, d, g);
    for (Vec3& p : points) p = to_base * p;
    const Aabb box = aabb_of(points);
    height_ = std::max(height_, box.high.z);
    if (points.empty() || box.low.z > high) continue;
    const Vec3 middle = box.center();
    double radius = 0;
    for (Vec3 p : points) radius = std::max(radius, std::hypot(p.x - middle.x, p.y - middle.y));
    discs_.push_back({middle.x, middle.y, radius});
  }
  // Discs inside of other discs are redundant.
  std::ranges::sort(discs_, std::greater<>{}, &Disc::radius);
  std::vector<Disc> kept;
  for (const Disc& disc : discs_) {
    const bool inside = std::ranges::any_of(kept, [&](const Disc& other) {
      return std::hypot(disc.x - other.x, disc.y - other.y) + disc.radius <= other.radius + 0.005;
    });
    if (!inside) kept.push_back(disc);
    radius_ = std::max(radius_, std::hypot(disc.x, disc.y) + disc.radius);
  }
  discs_ = std::move(kept);
}

double Footprint::clearance(const OccupancyGrid& floor, double x, double y, double yaw) const {
  const double c = std::cos(yaw), s = std::sin(yaw);
  double minimum = 1e10;
  for (const Disc& disc : discs_)
    minimum = std::min(
        minimum,
        floor.clearance(x + c * disc.x - s * disc.y, y + s * disc.x + c * disc.y) - disc.radius);
  return minimum;
}

bool Footprint::fits(const OccupancyGrid& floor, double x, double y, double yaw,
                     double margin) const {
  const double c = std::cos(yaw), s = std::sin(yaw);
  for (const Disc& disc : discs_) {
    if (floor.clearance(x + c * disc.x - s * disc.y, y + s * disc.x + c * disc.y) <
        disc.radius + margin)
      return false;
  }
  return true;
}

}  // namespace mjsense::tasks::scenes
