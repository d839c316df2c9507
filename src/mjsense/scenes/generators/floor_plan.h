// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where the rooms of a floor are, where one goes from one to the next, and what stands where:
// rectangles only.

#include <vector>

#include "mjsense/core/rng.h"

namespace mjsense {

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

// A wall between two rooms (the second -1: outside), from (x0, y0) to (x1, y1), along x or y.
struct PlannedWall {
  int room = 0, other = -1;
  double x0, y0, x1, y1;
  bool opening = false;     // a way through
  double from = 0, to = 0;  // m along it
  bool along_x() const { return y0 == y1; }
  double length() const { return along_x() ? x1 - x0 : y1 - y0; }
};

class FloorPlan {
 public:
  // 4 to 6 rooms on about 9 to 11 by 7 to 9 m, each open to its neighbours, all connected.
  explicit FloorPlan(Rng& rng);

  const Rect& whole() const { return whole_; }
  const std::vector<Rect>& rooms() const { return rooms_; }
  const std::vector<PlannedWall>& walls() const { return walls_; }

  // Whether something may stand there: inside its room, clear of what stands, not before an opening,
  // with a way past it, kRobot m wide, between all openings and to the thing itself.
  bool fits(int room, const Rect& space) const;
  void take(const Rect& space) { taken_.push_back(space); }
  // Something takes `wider` in the place of `space`, which it took: false, and as before, if that does not fit.
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

}  // namespace mjsense
