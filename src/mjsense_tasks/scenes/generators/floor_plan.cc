// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/floor_plan.h"

#include <algorithm>
#include <cmath>

namespace mjsense::tasks::scenes {
namespace {

constexpr double kMin = 2.9;        // m, minimum side of a room
constexpr double kShared = 1.75;    // m, minimum length of a shared wall with an opening
constexpr double kHalfWall = 0.06;  // m
constexpr double kRobot = 0.95;     // m, width of a path
constexpr double kCell = 0.1;       // m, grid of the path test

}  // namespace

FloorPlan::FloorPlan(Rng& rng) {
  do {
    whole_ = {0, 0, rng.uniform(9, 11), rng.uniform(7.2, 8.8)};
    rooms_.clear();
    walls_.clear();
    passages_.clear();
    divide(whole_, 4 + static_cast<int>(rng.below(3)), rng);
    find_walls(rng);
  } while (rooms_.size() < 4 || !connected(nullptr));
}

void FloorPlan::divide(const Rect& r, int rooms, Rng& rng) {
  const bool across = r.width() > r.depth();
  const double length = across ? r.width() : r.depth();
  if (rooms <= 1 || length < 2 * kMin) {
    rooms_.push_back(r);
    return;
  }
  const int first = rooms / 2;
  const double share = std::clamp(rng.uniform(0.42, 0.58) * length, kMin, length - kMin);
  Rect a = r, b = r;
  if (across) {
    a.x1 = b.x0 = r.x0 + share;
  } else {
    a.y1 = b.y0 = r.y0 + share;
  }
  divide(a, first, rng);
  divide(b, rooms - first, rng);
}

void FloorPlan::find_walls(Rng& rng) {
  const auto add = [&](PlannedWall wall) {
    if (wall.length() < 1e-6) return;
    const double length = wall.length();
    if (wall.other >= 0 && length > kShared) {
      const double wide = rng.uniform(1.15, 1.35), slack = length - wide - 0.3;
      wall.opening = true;
      wall.from = 0.15 + rng.uniform(0.15, 0.85) * slack;
      wall.to = wall.from + wide;
      // The areas in front of an opening must stay free on both sides.
      constexpr double kFree = 1.15;
      passages_.push_back(
          wall.along_x()
              ? Rect{wall.x0 + wall.from, wall.y0 - kFree, wall.x0 + wall.to, wall.y0 + kFree}
              : Rect{wall.x0 - kFree, wall.y0 + wall.from, wall.x0 + kFree, wall.y0 + wall.to});
    }
    walls_.push_back(wall);
  };
  const int n = static_cast<int>(rooms_.size());
  for (int i = 0; i < n; ++i) {
    const Rect& a = rooms_[i];
    for (int j = 0; j < n; ++j) {
      const Rect& b = rooms_[j];
      const double x0 = std::max(a.x0, b.x0), x1 = std::min(a.x1, b.x1);
      const double y0 = std::max(a.y0, b.y0), y1 = std::min(a.y1, b.y1);
      if (a.x1 == b.x0 && y1 > y0) add({i, j, a.x1, y0, a.x1, y1});
      if (a.y1 == b.y0 && x1 > x0) add({i, j, x0, a.y1, x1, a.y1});
    }
    if (a.x0 == whole_.x0) add({i, -1, a.x0, a.y0, a.x0, a.y1});
    if (a.x1 == whole_.x1) add({i, -1, a.x1, a.y0, a.x1, a.y1});
    if (a.y0 == whole_.y0) add({i, -1, a.x0, a.y0, a.x1, a.y0});
    if (a.y1 == whole_.y1) add({i, -1, a.x0, a.y1, a.x1, a.y1});
  }
}

bool FloorPlan::fits(int room, const Rect& space) const {
  const Rect& r = rooms_[room];
  const double wall = kHalfWall - 1e-3;
  if (space.x0 < r.x0 + wall || space.x1 > r.x1 - wall || space.y0 < r.y0 + wall ||
      space.y1 > r.y1 - wall)
    return false;
  const auto hits = [&](const Rect& other) { return overlap(space, other, 0.03); };
  if (std::ranges::any_of(taken_, hits) || std::ranges::any_of(passages_, hits)) return false;
  return connected(&space);
}

bool FloorPlan::widen(int room, const Rect& space, const Rect& wider) {
  const auto at = std::ranges::find(taken_, space);
  if (at == taken_.end()) return false;
  const Rect before = *at;
  *at = taken_.back();
  taken_.pop_back();
  const bool fit = fits(room, wider);
  taken_.push_back(fit ? wider : before);
  return fit;
}

// Whether a disc-shaped robot can drive from the first passage to all others, to the centre of each
// room's free area, and next to `more`.
bool FloorPlan::connected(const Rect* more) const {
  const int nx = static_cast<int>(whole_.width() / kCell),
            ny = static_cast<int>(whole_.depth() / kCell);
  std::vector<char> blocked(static_cast<std::size_t>(nx) * ny, 0);
  const auto fill = [&](const Rect& r, double by, char value) {
    for (int j = std::max(0, static_cast<int>((r.y0 - by) / kCell));
         j < std::min<double>(ny, (r.y1 + by) / kCell); ++j) {
      for (int i = std::max(0, static_cast<int>((r.x0 - by) / kCell));
           i < std::min<double>(nx, (r.x1 + by) / kCell); ++i)
        blocked[static_cast<std::size_t>(j) * nx + i] = value;
    }
  };
  const double radius = 0.5 * kRobot;
  for (const PlannedWall& w : walls_) {
    const auto piece = [&](double from, double to) {
      if (to <= from) return;
      fill(w.along_x() ? Rect{w.x0 + from, w.y0 - kHalfWall, w.x0 + to, w.y0 + kHalfWall}
                       : Rect{w.x0 - kHalfWall, w.y0 + from, w.x0 + kHalfWall, w.y0 + to},
           radius, 1);
    };
    piece(0, w.opening ? w.from : w.length());
    if (w.opening) piece(w.to, w.length());
  }
  for (const Rect& r : taken_) fill(r, radius, 1);
  if (more) fill(*more, radius, 1);
  if (passages_.empty()) return false;
  const auto cell_of = [&](const Rect& r) {
    const int i = static_cast<int>(0.5 * (r.x0 + r.x1) / kCell),
              j = static_cast<int>(0.5 * (r.y0 + r.y1) / kCell);
    return j * nx + i;
  };
  std::vector<int> open{cell_of(passages_[0])};
  if (blocked[open[0]]) return false;
  blocked[open[0]] = 2;
  for (std::size_t k = 0; k < open.size(); ++k) {
    const int i = open[k] % nx, j = open[k] / nx;
    for (const auto& [di, dj] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
      if (i + di < 0 || j + dj < 0 || i + di >= nx || j + dj >= ny) continue;
      const int next = (j + dj) * nx + i + di;
      if (blocked[next]) continue;
      blocked[next] = 2;
      open.push_back(next);
    }
  }
  for (const Rect& p : passages_) {
    if (blocked[cell_of(p)] != 2) return false;
  }
  for (const Rect& room : rooms_) {  // without a passage, the room is closed
    if (std::ranges::none_of(passages_, [&](const Rect& p) { return overlap(room, p); }))
      return false;
  }
  if (!more) return true;
  for (int c : open) {
    const double x = (c % nx + 0.5) * kCell, y = (c / nx + 0.5) * kCell;
    const double dx = std::max({more->x0 - x, x - more->x1, 0.0}),
                 dy = std::max({more->y0 - y, y - more->y1, 0.0});
    if (std::hypot(dx, dy) < radius + 0.15) return true;
  }
  return false;
}

}  // namespace mjsense::tasks::scenes
