// SPDX-License-Identifier: Apache-2.0
#pragma once
// Occupancy grid of a floor, seen from above and computed from the geoms of any compiled model,
// with the distance of each position to the nearest occupied cell.

#include <mujoco/mujoco.h>

#include <functional>
#include <span>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense::tasks::scenes {

struct OccupancyCfg {
  double cell = 0.05;             // m
  double low = 0.05, high = 1.6;  // m, world frame; geoms below or above are not obstacles
  double margin = 0.5;            // m, of free floor around the geoms
  double max_extent = 60;         // m, side of the grid; geoms farther out are ignored
  // Displacements (world frame) of a geom that may stand at different positions in different
  // episodes. The geom occupies the hull of all of them. Empty function or empty list: the geom
  // does not move.
  std::function<std::vector<Pose>(int geom)> elsewhere;
};

class OccupancyGrid {
 public:
  // Uses the colliding geoms that `counts` accepts, at their positions in `data` (whose kinematics
  // must be up to date). A geom occupies the convex hull of its projection on the floor. Horizontal
  // planes are floors. Throws ValueError if there are no such geoms.
  OccupancyGrid(const mjModel* model, const mjData* data,
                const std::function<bool(int geom)>& counts, const OccupancyCfg& cfg = {});

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  double cell() const { return cell_; }
  // Centre of a cell, m, world frame.
  double x(int column) const { return x0_ + (column + 0.5) * cell_; }
  double y(int row) const { return y0_ + (row + 0.5) * cell_; }
  bool taken(int column, int row) const { return taken_[index(column, row)] != 0; }
  // Distance (m) from a position to the nearest occupied cell. It is measured between cell centres
  // and slightly reduced; 0 inside of obstacles and outside of the grid.
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

// Footprint of a robot in its base frame: discs that cover its projection on the floor.
struct Disc {
  double x, y, radius;  // m
};
class Footprint {
 public:
  // Uses the colliding geoms that `counts` accepts and that reach below `high` m, at their
  // positions in `data`. `base` is X_WB.
  Footprint(const mjModel* model, const mjData* data, const std::function<bool(int geom)>& counts,
            const Pose& base, double high);
  std::span<const Disc> discs() const { return discs_; }
  // Maximum distance (m) from the base's origin.
  double radius() const { return radius_; }
  double height() const { return height_; }
  // Whether the robot at x, y, yaw keeps the distance `margin` (m) from all obstacles.
  bool fits(const OccupancyGrid& floor, double x, double y, double yaw, double margin) const;
  double clearance(const OccupancyGrid& floor, double x, double y, double yaw) const;

 private:
  std::vector<Disc> discs_;
  double radius_ = 0, height_ = 0;
};

}  // namespace mjsense::tasks::scenes
