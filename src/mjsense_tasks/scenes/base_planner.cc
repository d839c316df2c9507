// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/base_planner.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <queue>

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr double kTurnCost = 0.25;  // m, cost of turning by 45 degrees
constexpr double kAsideCost =
    0.8;  // per metre, at right angles to the heading; twice that backwards
constexpr double kNearCost = 3.0;    // per metre and metre below comfort
constexpr double kCheck = 0.04;      // m, between poses checked for collision
constexpr double kCheckTurn = 0.12;  // rad
constexpr double kBlend = 0.5;       // m, distance over which a base turns while it drives
constexpr std::array<std::array<int, 2>, 8> kHeadingSteps{
    {{1, 0}, {1, 1}, {0, 1}, {-1, 1}, {-1, 0}, {-1, -1}, {0, -1}, {1, -1}}};

double distance(const BasePose& a, const BasePose& b) { return std::hypot(a.x - b.x, a.y - b.y); }

}  // namespace

double wrapped(double angle) { return std::remainder(angle, 2 * pi); }

BasePlanner::BasePlanner(const OccupancyGrid& floor, const Footprint& footprint,
                         const BaseRouteCfg& cfg)
    : floor_(floor), footprint_(footprint), cfg_(cfg) {
  x0_ = floor.x(0);
  y0_ = floor.y(0);
  columns_ = std::max(1, static_cast<int>(floor.columns() * floor.cell() / cfg.step));
  rows_ = std::max(1, static_cast<int>(floor.rows() * floor.cell() / cfg.step));
  clearance_.resize(static_cast<std::size_t>(columns_) * rows_ * kHeadings);
  for (std::size_t n = 0; n < clearance_.size(); ++n) {
    const BasePose p = pose(n);
    clearance_[n] = static_cast<float>(footprint_.clearance(floor_, p.x, p.y, p.yaw) - cfg_.margin);
  }
}

BasePose BasePlanner::pose(std::size_t node) const {
  const std::size_t place = node / kHeadings;
  return {x0_ + static_cast<double>(place % columns_) * cfg_.step,
          y0_ + static_cast<double>(place / columns_) * cfg_.step,
          wrapped(0.25 * pi * static_cast<double>(node % kHeadings))};
}

bool BasePlanner::free_between(const BasePose& a, const BasePose& b) const {
  const double turn = wrapped(b.yaw - a.yaw);
  const int steps =
      1 + static_cast<int>(std::max(distance(a, b) / kCheck, std::abs(turn) / kCheckTurn));
  for (int i = 0; i <= steps; ++i) {
    const double s = static_cast<double>(i) / steps;
    if (!free({std::lerp(a.x, b.x, s), std::lerp(a.y, b.y, s), a.yaw + s * turn})) return false;
  }
  return true;
}

std::vector<BasePose> BasePlanner::find(
    const BasePose& from, const std::function<bool(const BasePose&)>& wanted,
    const std::function<double(double, double)>& at_least) const {
  constexpr auto kNone = std::numeric_limits<std::uint32_t>::max();
  std::vector<float> cost(clearance_.size(), std::numeric_limits<float>::infinity());
  std::vector<std::uint32_t> before(clearance_.size(), kNone);
  using Entry = std::pair<float, std::uint32_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  const auto push = [&](std::size_t n, double c, std::uint32_t by) {
    if (c >= cost[n]) return;
    cost[n] = static_cast<float>(c);
    before[n] = by;
    const BasePose p = pose(n);
    open.emplace(static_cast<float>(c + at_least(p.x, p.y)), static_cast<std::uint32_t>(n));
  };
  // Connects the start to nearby lattice states, so that a base that starts slightly too close to
  // an obstacle can leave.
  const int c0 = static_cast<int>(std::floor((from.x - x0_) / cfg_.step)),
            r0 = static_cast<int>(std::floor((from.y - y0_) / cfg_.step));
  for (int r = std::max(0, r0 - 1); r <= std::min(rows_ - 1, r0 + 2); ++r) {
    for (int c = std::max(0, c0 - 1); c <= std::min(columns_ - 1, c0 + 2); ++c) {
      for (int h = 0; h < kHeadings; ++h) {
        const BasePose p = pose(node(c, r, h));
        const double turn = std::abs(wrapped(p.yaw - from.yaw));
        if (clearance_[node(c, r, h)] < 0 || turn > 0.4 * pi) continue;
        push(node(c, r, h),
             distance(p, from) * (1 + 2 * kAsideCost) + kTurnCost * turn / (0.25 * pi), kNone);
      }
    }
  }
  while (!open.empty()) {
    const auto [estimate, n] = open.top();
    open.pop();
    const BasePose p = pose(n);
    if (estimate > cost[n] + at_least(p.x, p.y) + 1e-4) continue;  // an outdated entry of the queue
    if (wanted(p)) {
      std::vector<BasePose> path;
      for (std::uint32_t k = n; k != kNone; k = before[k]) path.push_back(pose(k));
      path.push_back(from);
      std::ranges::reverse(path);
      return straightened(path);
    }
    const int h = static_cast<int>(n % kHeadings), c = static_cast<int>(n / kHeadings) % columns_,
              r = static_cast<int>(n / kHeadings) / columns_;
    for (const int turn : {1, kHeadings - 1}) {
      const std::size_t next = node(c, r, (h + turn) % kHeadings);
      if (clearance_[next] >= 0) push(next, cost[n] + kTurnCost, n);
    }
    for (int heading = 0; heading < kHeadings; ++heading) {
      const int aside = std::min((heading - h + kHeadings) % kHeadings,
                                 (h - heading + kHeadings) % kHeadings);  // in steps of 45 degrees
      if (!cfg_.sideways && aside % 4 != 0) continue;
      const int c1 = c + kHeadingSteps[heading][0], r1 = r + kHeadingSteps[heading][1];
      if (c1 < 0 || r1 < 0 || c1 >= columns_ || r1 >= rows_) continue;
      const std::size_t next = node(c1, r1, h);
      if (clearance_[next] < 0) continue;
      const double length =
          cfg_.step * std::hypot(kHeadingSteps[heading][0], kHeadingSteps[heading][1]);
      const double tight = std::max(0.0, cfg_.comfort - clearance_[next]);
      push(next, cost[n] + length * (1 + 0.5 * kAsideCost * aside + kNearCost * tight), n);
    }
  }
  return {};
}

std::vector<BasePose> BasePlanner::find(const BasePose& from, const BasePose& to) const {
  if (free_between(from, to) && distance(from, to) < 2 * cfg_.step) return {from, to};
  std::vector<BasePose> path = find(
      from,
      [&](const BasePose& p) {
        return distance(p, to) < 1.5 * cfg_.step && std::abs(wrapped(p.yaw - to.yaw)) < 0.2 * pi &&
               free_between(p, to);
      },
      [&](double x, double y) {
        return std::max(0.0, std::hypot(x - to.x, y - to.y) - 1.5 * cfg_.step);
      });
  if (!path.empty()) path.push_back(to);
  return path;
}

// Segment from one pose to another: the base faces the direction of motion, turning before or on
// the first part, and turns to the target yaw at the end. Returns false if it collides.
bool BasePlanner::leg(const BasePose& from, const BasePose& to, std::vector<BasePose>& out) const {
  const double length = distance(from, to);
  if (length < 1e-6) {
    if (!free_between(from, to)) return false;
    out.push_back(to);
    return true;
  }
  const double heading = std::atan2(to.y - from.y, to.x - from.x);
  const BasePose turned{from.x, from.y, heading}, there{to.x, to.y, heading};
  if (cfg_.sideways && length > kBlend) {
    const double s = kBlend / length;
    const BasePose blended{std::lerp(from.x, to.x, s), std::lerp(from.y, to.y, s), heading};
    if (std::abs(wrapped(heading - from.yaw)) < 0.6 * pi && free_between(from, blended) &&
        free_between(blended, there)) {
      out.push_back(blended);
      out.push_back(there);
      return true;
    }
  }
  if (!free_between(from, turned) || !free_between(turned, there)) return false;
  if (std::abs(wrapped(heading - from.yaw)) > 1e-3) out.push_back(turned);
  out.push_back(there);
  return true;
}

std::vector<BasePose> BasePlanner::straightened(const std::vector<BasePose>& path) const {
  std::vector<BasePose> out{path.front()};
  std::size_t at = 0;
  while (at + 1 < path.size()) {
    std::size_t next = at + 1;
    std::vector<BasePose> best;
    for (std::size_t k = path.size() - 1; k > at + 1; --k) {
      if (distance(out.back(), path[k]) < 0.25) continue;
      std::vector<BasePose> legs;
      if (!leg(out.back(), path[k], legs)) continue;
      // The path must be able to continue from the end of the shortcut.
      if (!free_between(legs.back(), path[k])) continue;
      next = k;
      best = std::move(legs);
      break;
    }
    if (best.empty()) best.push_back(path[next]);
    out.insert(out.end(), best.begin(), best.end());
    at = next;
    if (at + 1 == path.size() && std::abs(wrapped(out.back().yaw - path.back().yaw)) > 1e-3)
      out.push_back(path.back());
  }
  return out;
}

std::vector<TimedBasePose> timed(std::span<const BasePose> path, const BaseSpeeds& v, double dt) {
  std::vector<TimedBasePose> out;
  if (path.empty()) return out;
  double start = 0, yaw = path[0].yaw;
  out.push_back({0, path[0]});
  // Trapezoidal speed profile over `length`, from rest to rest: duration (s), and the fraction
  // completed at a time.
  struct Ramp {
    double length, speed, acceleration, ramp, total;
    Ramp(double l, double s, double a)
        : length(l), speed(std::min(s, std::sqrt(l * a))), acceleration(a) {
      ramp = speed > 0 ? speed / a : 0;
      total = speed > 0 ? ramp + l / speed : 0;
    }
    double done(double t) const {
      if (length <= 0 || t >= total) return 1;
      if (t < ramp) return 0.5 * acceleration * t * t / length;
      if (t > total - ramp) return 1 - 0.5 * acceleration * (total - t) * (total - t) / length;
      return (speed * (t - 0.5 * ramp)) / length;
    }
  };
  for (std::size_t i = 1; i < path.size(); ++i) {
    const BasePose& a = path[i - 1];
    const double turn = wrapped(path[i].yaw - yaw);
    const Ramp go(distance(a, path[i]), v.speed, v.acceleration),
        spin(std::abs(turn), v.turn, v.turn_acceleration);
    const Ramp& slow = go.total >= spin.total ? go : spin;
    if (slow.total <= 0) continue;
    const int steps = std::max(1, static_cast<int>(std::ceil(slow.total / dt)));
    for (int k = 1; k <= steps; ++k) {
      const double t = slow.total * k / steps, s = slow.done(t);
      out.push_back({start + t,
                     {std::lerp(a.x, path[i].x, s), std::lerp(a.y, path[i].y, s), yaw + s * turn}});
    }
    start += slow.total;
    yaw += turn;
  }
  return out;
}

}  // namespace mjsense::tasks::scenes
