// SPDX-License-Identifier: Apache-2.0
#pragma once
// What of a floor is taken: a grid seen from above, made of the geoms of a compiled model, whoever
// wrote it. And how far each place is from what is taken.

#include <mujoco/mujoco.h>

#include <functional>
#include <span>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

struct OccupancyCfg {
  double cell = 0.05;             // m
  double low = 0.05, high = 1.6;  // m, world: what lies below or above is in nobody's way
  double margin = 0.5;            // m, of floor around what there is
  double max_extent = 60;         // m, a side; what is further out counts for nothing
  // Displacements in the world after which a geom may stand where it stands in some episode: it takes the hull of all
  // these places. Empty, or an empty list: it stands where it is.
  std::function<std::vector<Pose>(int geom)> elsewhere;
};

class Occupancy {
 public:
  // Of the geoms that touch and that `counts` accepts, where `data` has them (its kinematics must be
  // up to date). A geom takes the convex hull of what it covers of the floor. Horizontal planes are
  // floors. Throws ValueError where nothing is left.
  Occupancy(const mjModel* model, const mjData* data, const std::function<bool(int geom)>& counts,
            const OccupancyCfg& cfg = {});

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  double cell() const { return cell_; }
  // Middle of a cell, m in the world.
  double x(int column) const { return x0_ + (column + 0.5) * cell_; }
  double y(int row) const { return y0_ + (row + 0.5) * cell_; }
  bool taken(int column, int row) const { return taken_[index(column, row)] != 0; }
  // Distance (m) from a place to the nearest cell that is taken, between middles of cells and a bit
  // less; 0 inside and off the grid.
  double clearance(double x, double y) const;

 private:
  std::size_t index(int column, int row) const {
    return static_cast<std::size_t>(row) * columns_ + column;
  }
  void fill(std::span<const Vec3> outline);
  void measure();

  double cell_, x0_ = 0, y0_ = 0;
  int columns_ = 0, rows_ = 0;
  std::vector<char> taken_;      // [rows, columns]
  std::vector<float> distance_;  // [rows, columns] m
};

// What a robot takes of the floor, seen from above in its base frame: discs that cover it.
struct Disc {
  double x, y, radius;  // m
};
class Footprint {
 public:
  // Of the geoms that touch of the bodies that `counts` accepts, below `high` m, as `data` has them;
  // X_WB is the base.
  Footprint(const mjModel* model, const mjData* data, const std::function<bool(int geom)>& counts,
            const Pose& base, double high);
  std::span<const Disc> discs() const { return discs_; }
  // About the base's origin.
  double radius() const { return radius_; }
  double height() const { return height_; }
  // Whether it keeps `margin` (m) at x, y, yaw from all that is taken.
  bool fits(const Occupancy& floor, double x, double y, double yaw, double margin) const;
  double clearance(const Occupancy& floor, double x, double y, double yaw) const;

 private:
  std::vector<Disc> discs_;
  double radius_ = 0, height_ = 0;
};

}  // namespace mjsense
