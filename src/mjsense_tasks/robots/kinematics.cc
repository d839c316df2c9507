// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/kinematics.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"

namespace mjsense::tasks::robots {
namespace {

// kDamping: eps of damped_step(). kAttempt: iterations from each restart; a solution is usually
// found within 10.
constexpr double kDamping = 1e-12;
constexpr int kAttempt = 25;
// A restart takes the best of kCandidates configurations. After it no joint moves by more than
// kFarthest in one iteration.
constexpr int kCandidates = 16;
constexpr double kFarthest = 0.4;  // rad or m
constexpr double kSlack = 1e-3;    // m; larger than the position error of a solution
// For joint_motion(), m or rad per unit of q: damping begins if the leaf moves by less than
// kSingular per unit of joint motion, and rises to kMaxDamping at a singular configuration.
constexpr double kSingular = 0.1, kMaxDamping = 0.05;

// Solves (J J^T + eps I) y = e for a [6, n] Jacobian, by Cholesky factorisation, and returns J^T y.
void damped_step(std::span<const double> jacobian, int n, double eps, const double (&e)[6],
                 std::span<double> dq) {
  double a[6][6];
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      double s = i == j ? eps : 0.0;
      for (int k = 0; k < n; ++k) s += jacobian[i * n + k] * jacobian[j * n + k];
      a[i][j] = s;
    }
  }
  double y[6];
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) {
      double s = a[i][j];
      for (int k = 0; k < j; ++k) s -= a[i][k] * a[j][k];
      // At a singular configuration rounding may leave a pivot at or below zero.
      a[i][j] = i == j ? std::sqrt(std::max(s, eps)) : s / a[j][j];
    }
    double s = e[i];
    for (int k = 0; k < i; ++k) s -= a[i][k] * y[k];
    y[i] = s / a[i][i];
  }
  for (int i = 5; i >= 0; --i) {
    for (int k = i + 1; k < 6; ++k) y[i] -= a[k][i] * y[k];
    y[i] /= a[i][i];
  }
  for (int k = 0; k < n; ++k) {
    dq[k] = 0;
    for (int i = 0; i < 6; ++i) dq[k] += jacobian[i * n + k] * y[i];
  }
}

// The first links of a chain if their joints may not move, and the frame after the last of them.
struct Still {
  std::size_t links;
  Pose frame;
};

// Returns the frame after the first `many` links, in the base frame.
Pose carried(std::span<const Link> links, const Still& still, std::size_t many,
             std::span<const double> q) {
  Pose pose = still.frame;
  for (std::size_t i = still.links; i < many; ++i) {
    pose = pose * links[i].fixed;
    links[i].move(pose, q[i]);
  }
  return pose;
}

Still still_part(std::span<const Link> links, std::span<const double> q,
                 std::span<const bool> moves) {
  std::size_t n = 0;
  while (n < moves.size() && !moves[n]) ++n;
  return {n, carried(links, {0, {}}, n, q)};
}

// Returns the pose of the leaf and writes the Jacobian [6, J] of the joints after `still`.
Pose jacobian_of(std::span<const Link> links, const Still& still, const Pose& tail,
                 std::span<const double> q, std::span<double> jacobian) {
  const std::size_t n = links.size() - still.links;
  std::array<Vec3, Chain::kMaxJoints> axes, anchors;
  Pose pose = still.frame;
  for (std::size_t i = 0; i < n; ++i) {
    const Link& link = links[still.links + i];
    pose = pose * link.fixed;
    axes[i] = rotate(pose.q, link.axis);
    anchors[i] = pose * link.anchor;
    link.move(pose, q[still.links + i]);
  }
  const Pose leaf = pose * tail;
  for (std::size_t i = 0; i < n; ++i) {
    const bool slide = links[still.links + i].slide;
    const Vec3 v = slide ? axes[i] : cross(axes[i], leaf.p - anchors[i]);
    const Vec3 w = slide ? Vec3{} : axes[i];
    for (int k = 0; k < 3; ++k) {
      jacobian[k * n + i] = v[k];
      jacobian[(3 + k) * n + i] = w[k];
    }
  }
  return leaf;
}

// True if the target is farther from the first moving joint than the sum of all link lengths.
bool is_out_of_reach(std::span<const Link> links, const Still& still, const Pose& tail, Vec3 target,
                     std::span<const double> low, std::span<const double> high) {
  if (still.links == links.size()) return false;
  double reach = 0;
  for (std::size_t i = still.links; i < links.size(); ++i) {
    const Link& link = links[i];
    const Vec3 next = i + 1 < links.size() ? links[i + 1].fixed * links[i + 1].anchor : tail.p;
    reach += norm(next - link.anchor);
    if (link.slide) reach += std::max(std::abs(low[i] - link.zero), std::abs(high[i] - link.zero));
  }
  const Link& first = links[still.links];
  return norm(target - still.frame * (first.fixed * first.anchor)) > reach + kSlack;
}

// The root of x^(n+1) = x + 1, the generalised golden ratio.
double golden(int n) {
  static const auto kAll = [] {
    std::array<double, Chain::kMaxJoints + 1> all;
    for (int i = 0; i <= Chain::kMaxJoints; ++i) {
      all[i] = 1.5;
      for (int k = 0; k < 30; ++k) all[i] = std::pow(1.0 + all[i], 1.0 / (i + 1));
    }
    return all;
  }();
  return kAll[n];
}

}  // namespace

Chain::Chain(const mjModel* model, int base_body, int leaf_site, std::span<const int> moving) {
  std::vector<int> path;
  for (int b = model->site_bodyid[leaf_site]; b != base_body; b = model->body_parentid[b]) {
    if (b == 0) {
      throw ValueError(fmt::format("site '{}' is not on a body below '{}'",
                                   mj_id2name(model, mjOBJ_SITE, leaf_site),
                                   mj_id2name(model, mjOBJ_BODY, base_body)));
    }
    path.push_back(b);
  }
  std::reverse(path.begin(), path.end());
  Pose fixed;
  for (int b : path) {
    fixed = fixed * body_frame(model, b);
    for (int j = model->body_jntadr[b]; j < model->body_jntadr[b] + model->body_jntnum[b]; ++j) {
      if (std::find(moving.begin(), moving.end(), j) == moving.end()) continue;
      const int type = model->jnt_type[j];
      if (type != mjJNT_HINGE && type != mjJNT_SLIDE) {
        throw ValueError(fmt::format("joint '{}' of a kinematic chain must be a hinge or a slide",
                                     mj_id2name(model, mjOBJ_JOINT, j)));
      }
      if (joints_.size() == kMaxJoints)
        throw ValueError(fmt::format("a kinematic chain has at most {} joints", kMaxJoints));
      links_.emplace_back(model, j, fixed);
      joints_.push_back(j);
      const bool limited = model->jnt_limited[j];
      low_.push_back(limited ? model->jnt_range[2 * j] : -std::numeric_limits<double>::infinity());
      high_.push_back(limited ? model->jnt_range[2 * j + 1]
                              : std::numeric_limits<double>::infinity());
      fixed = Pose{};
    }
  }
  tail_ =
      fixed * Pose{vec3(model->site_pos + 3 * leaf_site), quat(model->site_quat + 4 * leaf_site)};
}

Pose Chain::fk(std::span<const double> q) const {
  return carried(links_, {0, {}}, links_.size(), q) * tail_;
}

Pose Chain::jacobian(std::span<const double> q, std::span<double> jacobian) const {
  return jacobian_of(links_, {0, {}}, tail_, q, jacobian);
}

void Chain::joint_motion(std::span<const double> q, const Twist& twist, std::span<double> dq,
                         std::span<const bool> moves) const {
  std::array<double, 6 * kMaxJoints> storage;
  const std::span<double> jac(storage.data(), 6 * links_.size());
  jacobian(q, jac);
  const int n = static_cast<int>(links_.size());
  for (std::size_t k = 0; k < moves.size(); ++k) {
    for (int i = 0; !moves[k] && i < 6; ++i) jac[i * n + k] = 0;
  }
  const double e[6] = {twist.v.x, twist.v.y, twist.v.z, twist.w.x, twist.w.y, twist.w.z};
  damped_step(jac, n, kDamping, e, dq);
  double motion = 0;
  for (double d : dq.first(n)) motion += d * d;
  // The gain of J for this twist is at least J's smallest singular value.
  const double gain = norm(twist) / std::sqrt(motion), part = gain / kSingular;
  if (!(part < 1)) return;  // also for a twist of 0
  damped_step(jac, n, kMaxDamping * kMaxDamping * (1 - part * part), e, dq);
}

// Additive recurrence: the fractional parts of k * alpha_i, with alpha_i the powers of the inverse
// generalised golden ratio, fill the box of joint ranges evenly for any number of joints.
void Chain::spread(int k, std::span<double> q, std::span<const bool> moves) const {
  const int n = static_cast<int>(links_.size());
  const double phi = golden(n);
  double alpha = 1.0;
  for (int i = 0; i < n; ++i) {
    alpha /= phi;
    if (!moves.empty() && !moves[i]) continue;
    const double u = std::fmod(0.5 + k * alpha, 1.0);
    const double low = std::max(low_[i], -std::numbers::pi),
                 high = std::min(high_[i], std::numbers::pi);
    q[i] = low < high ? low + u * (high - low) : low_[i];
  }
}

void Chain::restart(const Pose& target, int attempt, std::span<double> q,
                    std::span<const bool> moves) const {
  std::array<double, kMaxJoints> storage;
  const std::span<double> other(storage.data(), q.size());
  std::ranges::copy(q, other.begin());
  const Still still = still_part(links_, q, moves);
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kCandidates; ++k) {
    spread(1 + attempt * kCandidates + k, other, moves);
    const double distance =
        norm(log6(inverse(carried(links_, still, links_.size(), other) * tail_) * target));
    if (distance >= nearest) continue;
    nearest = distance;
    std::ranges::copy(other, q.begin());
  }
}

bool Chain::ik(const Pose& target, std::span<double> q, int max_iterations, double tolerance,
               std::span<const bool> moves) const {
  const Still still = still_part(links_, q, moves);
  if (is_out_of_reach(links_, still, tail_, target.p, low_, high_)) return false;
  const std::size_t first = still.links, n = links_.size() - first;
  std::array<double, 6 * kMaxJoints> jac;
  std::array<double, kMaxJoints> dq;
  int restarts = 0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const bool tracking = iteration < kTracking;
    if (!tracking && (iteration - kTracking) % kAttempt == 0) restart(target, restarts++, q, moves);
    const Pose leaf = jacobian_of(links_, still, tail_, q, {jac.data(), 6 * n});
    const Twist body = log6(inverse(leaf) * target);
    if (norm(body) < tolerance) return true;
    for (std::size_t k = first; k < moves.size(); ++k) {
      for (std::size_t i = 0; !moves[k] && i < 6; ++i) jac[i * n + k - first] = 0;
    }
    const Vec3 v = rotate(leaf.q, body.v), w = rotate(leaf.q, body.w);
    const double e[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
    damped_step({jac.data(), 6 * n}, static_cast<int>(n), kDamping, e, {dq.data(), n});
    if (!tracking) {
      double farthest = kFarthest;
      for (std::size_t k = 0; k < n; ++k) farthest = std::max(farthest, std::abs(dq[k]));
      for (std::size_t k = 0; k < n; ++k) dq[k] *= kFarthest / farthest;
    }
    for (std::size_t k = first; k < first + n; ++k) {
      if (moves.empty() || moves[k]) q[k] = std::clamp(q[k] + dq[k - first], low_[k], high_[k]);
    }
  }
  return false;
}

}  // namespace mjsense::tasks::robots
