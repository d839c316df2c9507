// SPDX-License-Identifier: Apache-2.0
#pragma once
// Floor plan of axis-aligned rectangles: the rooms, the passages between them, and the space taken
// by furniture.

#include <vector>

#include "mjsense/core/rng.h"

namespace mjsense::tasks::scenes {

struct Rect {
  double x0, y0, x1, y1;  // m
  double width() const { return x1 - x0; }
  double depth() const { return y1 - y0; }
  double area() const { return width() * depth(); }
  bool operator==(const Rect&) const = default;
};
inline bool overlap(const Rect& a, const Rect& b, double margin = 0) {
  return a.x0 < b.x1 + margin && b.x0 < a.x1 + margin && a.y0 < b.y1 + margin &&
         b.y0 < a.y1 + margin;
}

// A wall between two rooms, from (x0, y0) to (x1, y1), parallel to x or y. `other` is -1 for an
// outer wall.
struct PlannedWall {
  int room = 0, other = -1;
  double x0, y0, x1, y1;
  bool opening = false;     // has a passage
  double from = 0, to = 0;  // m along the wall, of the passage
  bool along_x() const { return y0 == y1; }
  double length() const { return along_x() ? x1 - x0 : y1 - y0; }
};

class FloorPlan {
 public:
  // 4 to 6 rooms on about 9 to 11 by 7 to 9 m, each with a passage to a neighbour, all connected.
  explicit FloorPlan(Rng& rng);

  const Rect& whole() const { return whole_; }
  const std::vector<Rect>& rooms() const { return rooms_; }
  const std::vector<PlannedWall>& walls() const { return walls_; }

  // Whether furniture may be placed there: inside its room, not overlapping other furniture or the
  // area in front of an opening, and such that paths of width kRobot (m) still connect all openings
  // and reach the piece itself.
  bool fits(int room, const Rect& space) const;
  void take(const Rect& space) { taken_.push_back(space); }
  // Replaces the occupied rectangle `space` by `wider`. Returns false and changes nothing if that
  // does not fit.
  bool widen(int room, const Rect& space, const Rect& wider);

 private:
  void divide(const Rect& rect, int rooms, Rng& rng);
  void find_walls(Rng& rng);
  bool connected(const Rect* more) const;

  Rect whole_;
  std::vector<Rect> rooms_;
  std::vector<PlannedWall> walls_;
  std::vector<Rect> taken_, passages_;
};

}  // namespace mjsense::tasks::scenes
