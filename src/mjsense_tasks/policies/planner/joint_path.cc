// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/policies/planner/joint_path.h"

#include <algorithm>
#include <cmath>

namespace mjsense::tasks::policies {
namespace {

using Config = std::span<const double>;

double farthest(Config a, Config b) {
  double d = 0;
  for (std::size_t k = 0; k < a.size(); ++k) d = std::max(d, std::abs(a[k] - b[k]));
  return d;
}

void mix(Config a, Config b, double s, std::vector<double>& out) {
  out.resize(a.size());
  for (std::size_t k = 0; k < a.size(); ++k) out[k] = a[k] + s * (b[k] - a[k]);
}

// (1-s)^2 a + 2 s (1-s) c + s^2 b: from a to b, beginning and ending in the direction of c.
void blend(Config a, Config c, Config b, double s, std::vector<double>& out) {
  out.resize(a.size());
  for (std::size_t d = 0; d < a.size(); ++d)
    out[d] = (1 - s) * (1 - s) * a[d] + 2 * s * (1 - s) * c[d] + s * s * b[d];
}

constexpr int kChecks = 8;         // checked pieces of a rounded corner
constexpr double kArcStep = 0.01;  // rad or m between two samples of a path

// Dense samples [M, n] of the path with parabolas at its corners, approximately evenly spaced.
std::vector<double> round_corners(std::span<const double> w, std::size_t n,
                                  const FreeSpace& is_free, double share) {
  const std::size_t many = w.size() / n;
  std::vector<double> out, a, b, mid, p;
  const auto row = [&](std::size_t i) { return w.subspan(i * n, n); };
  const auto line_to = [&](Config to) {
    const std::vector<double> from(out.end() - n, out.end());
    const int steps = std::max(1, static_cast<int>(std::ceil(farthest(from, to) / kArcStep)));
    for (int k = 1; k <= steps; ++k) {
      mix(from, to, static_cast<double>(k) / steps, p);
      out.insert(out.end(), p.begin(), p.end());
    }
  };
  out.insert(out.end(), row(0).begin(), row(0).end());
  for (std::size_t i = 1; i + 1 < many; ++i) {
    // The parabola runs from a, before the corner c, to b, after it.
    const Config c = row(i);
    double part = share;
    bool round = false;
    for (int k = 0; k < 4 && !round; ++k, part *= 0.5) {
      mix(c, row(i - 1), part, a);
      mix(c, row(i + 1), part, b);
      round = true;
      mid = a;
      for (int j = 1; j <= kChecks && round; ++j) {
        blend(a, c, b, static_cast<double>(j) / kChecks, p);
        round = is_free.at(p) && is_free.between(mid, p);
        mid = p;
      }
    }
    if (!round) {
      line_to(c);
      continue;
    }
    line_to(a);
    const double length = farthest(a, c) + farthest(c, b);
    const int steps = std::max(4, static_cast<int>(std::ceil(length / kArcStep)));
    for (int k = 1; k <= steps; ++k) {
      blend(a, c, b, static_cast<double>(k) / steps, p);
      out.insert(out.end(), p.begin(), p.end());
    }
  }
  line_to(row(many - 1));
  return out;
}

// Factor (at least 1) by which a path must be slower to satisfy the limits. Its times are evenly
// spaced.
double excess(const JointSpace& space, const CommandPath& path) {
  const std::size_t n = space.size(), many = path.times.size();
  const double dt = path.times[1] - path.times[0];
  const auto at = [&](std::size_t i, std::size_t d) {
    return path.points[std::min(i, many - 1) * n + d];
  };
  double factor = 1;
  for (std::size_t d = 0; d < n; ++d) {
    double before = 0;
    for (std::size_t i = 0; i < many; ++i) {  // at rest at both ends
      const double speed = (at(i + 1, d) - at(i, d)) / dt;
      factor = std::max(factor, std::abs(speed) / space.speed[d]);
      factor = std::max(factor, std::sqrt(std::abs(speed - before) / dt / space.acceleration[d]));
      before = speed;
    }
  }
  return factor;
}

}  // namespace

CommandPath time_path(const JointSpace& space, int group, std::span<const double> waypoints,
                      const FreeSpace& is_free,
                      const std::function<Vec3(std::span<const double>)>& extra, double extra_speed,
                      double dt, const MotionCfg& cfg) {
  const std::size_t n = space.size();
  CommandPath out{.group = group, .times = {0}, .points = {}};
  if (waypoints.size() <= n || farthest(waypoints.first(n), waypoints.last(n)) < 1e-9) {
    if (waypoints.size() <= 2 * n) {
      out.points.assign(waypoints.end() - n, waypoints.end());
      return out;
    }
  }
  const std::vector<double> q = round_corners(waypoints, n, is_free, cfg.rounding);
  const int m = static_cast<int>(q.size() / n);
  // The path parameter is the sample index; q'(i) and q''(i) are finite differences. x(i) is the
  // square of its rate. The limits bound x from above, and a forward and a backward pass propagate
  // these bounds.
  const auto slope = [&](int i, std::size_t d) {
    const int lo = std::max(0, i - 1), hi = std::min(m - 1, i + 1);
    return (q[hi * n + d] - q[lo * n + d]) / (hi - lo);
  };
  const auto bend = [&](int i, std::size_t d) {
    if (i == 0 || i == m - 1) return 0.0;
    return q[(i + 1) * n + d] - 2 * q[i * n + d] + q[(i - 1) * n + d];
  };
  std::vector<double> x(m);
  std::vector<double> gain(m);  // maximum |d(rate)/dt| that the curvature term leaves
  for (int i = 0; i < m; ++i) {
    double maximum = 1e12;
    for (std::size_t d = 0; d < n; ++d) {
      const double s = std::abs(slope(i, d)), c = std::abs(bend(i, d));
      if (s > 1e-12) maximum = std::min(maximum, (space.speed[d] / s) * (space.speed[d] / s));
      // Half of the acceleration is reserved for the curvature, half for speeding up.
      if (c > 1e-12) maximum = std::min(maximum, 0.5 * space.acceleration[d] / c);
    }
    if (extra && extra_speed > 0) {
      const int lo = std::max(0, i - 1), hi = std::min(m - 1, i + 1);
      const double s =
          norm(extra(Config(q).subspan(hi * n, n)) - extra(Config(q).subspan(lo * n, n))) /
          (hi - lo);
      if (s > 1e-12) maximum = std::min(maximum, (extra_speed / s) * (extra_speed / s));
    }
    x[i] = maximum;
    double rise = 1e12;
    for (std::size_t d = 0; d < n; ++d) {
      const double s = std::abs(slope(i, d));
      const double left = space.acceleration[d] - std::abs(bend(i, d)) * maximum;
      if (s > 1e-12) rise = std::min(rise, std::max(0.5 * space.acceleration[d], left) / s);
    }
    gain[i] = rise;
  }
  x[0] = x[m - 1] = 0;
  for (int i = 1; i < m; ++i) x[i] = std::min(x[i], x[i - 1] + 2 * std::min(gain[i - 1], gain[i]));
  for (int i = m - 2; i >= 0; --i)
    x[i] = std::min(x[i], x[i + 1] + 2 * std::min(gain[i + 1], gain[i]));
  std::vector<double> time(m, 0);
  for (int i = 1; i < m; ++i)
    time[i] = time[i - 1] + 2 / std::max(1e-6, std::sqrt(x[i - 1]) + std::sqrt(x[i]));
  const int samples = std::max(1, static_cast<int>(std::ceil(time[m - 1] / dt)));
  out.times.clear();
  int i = 0;
  for (int k = 0; k <= samples; ++k) {
    const double t = time[m - 1] * k / samples;
    while (i + 2 < m && time[i + 1] <= t) ++i;
    // The rate is linear between two samples.
    const double a = std::sqrt(x[i]), span = time[i + 1] - time[i];
    const double rise = span > 0 ? (std::sqrt(x[i + 1]) - a) / span : 0;
    const double u = t - time[i];
    const double s = k == samples ? 1.0 : std::clamp(a * u + 0.5 * rise * u * u, 0.0, 1.0);
    out.times.push_back(t);
    // Cubic interpolation between the samples keeps the speed continuous.
    const double h01 = s * s * (3 - 2 * s), h10 = s * (1 - s) * (1 - s), h11 = s * s * (s - 1);
    for (std::size_t d = 0; d < n; ++d)
      out.points.push_back((1 - h01) * q[i * n + d] + h01 * q[(i + 1) * n + d] + h10 * slope(i, d) +
                           h11 * slope(i + 1, d));
  }
  // A uniform slowdown removes what still exceeds a limit between the samples.
  const double slower = excess(space, out);
  for (double& t : out.times) t *= slower;
  return out;
}

}  // namespace mjsense::tasks::policies
