// SPDX-License-Identifier: Apache-2.0
#pragma once
// Rigid-body poses in double precision: vectors, unit quaternions (wxyz), SE(3) with its
// exponential and logarithm.

#include <algorithm>
#include <array>
#include <cmath>

namespace mjsense {

struct Vec3 {
  double x = 0, y = 0, z = 0;
  double operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};

inline Vec3 vec3(const double* p) { return {p[0], p[1], p[2]}; }
inline void write_vec(Vec3 v, double* out) {
  out[0] = v.x;
  out[1] = v.y;
  out[2] = v.z;
}
inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(Vec3 a) { return std::sqrt(dot(a, a)); }
inline Vec3 normalized(Vec3 a) { return (1.0 / norm(a)) * a; }

struct Quat {
  double w = 1, x = 0, y = 0, z = 0;
};

inline Quat quat(const double* q) { return {q[0], q[1], q[2], q[3]}; }
inline void write_quat(Quat q, double* out) {
  out[0] = q.w;
  out[1] = q.x;
  out[2] = q.y;
  out[3] = q.z;
}
inline Quat operator*(Quat a, Quat b) {
  return {
      a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z, a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
      a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x, a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w};
}
inline Quat conjugate(Quat q) { return {q.w, -q.x, -q.y, -q.z}; }
inline Quat normalized(Quat q) {
  const double s = 1.0 / std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  return {s * q.w, s * q.x, s * q.y, s * q.z};
}
inline Vec3 rotate(Quat q, Vec3 v) {
  const Vec3 u{q.x, q.y, q.z};
  const Vec3 t = 2.0 * cross(u, v);
  return v + q.w * t + cross(u, t);
}
// Rotation by `angle` rad about a unit axis.
inline Quat axis_angle(Vec3 axis, double angle) {
  const double s = std::sin(0.5 * angle);
  return {std::cos(0.5 * angle), s * axis.x, s * axis.y, s * axis.z};
}
// Rotation whose matrix has these columns (orthonormal, right-handed).
Quat quat_from_columns(Vec3 x, Vec3 y, Vec3 z);

// Rotation vector of q (axis times angle in [0, pi]).
inline Vec3 log3(Quat q) {
  if (q.w < 0) q = {-q.w, -q.x, -q.y, -q.z};
  const Vec3 u{q.x, q.y, q.z};
  const double s = norm(u);
  if (s < 1e-12) return 2.0 * u;
  return (2.0 * std::atan2(s, q.w) / s) * u;
}
inline Quat exp3(Vec3 w) {
  const double angle = norm(w);
  if (angle < 1e-12) return normalized(Quat{1, 0.5 * w.x, 0.5 * w.y, 0.5 * w.z});
  return axis_angle((1.0 / angle) * w, angle);
}
// Angle of the rotation from a to b, rad in [0, pi].
inline double angle_between(Quat a, Quat b) { return norm(log3(conjugate(a) * b)); }

// X_AB is the pose of frame B in frame A: X_AB * X_BC = X_AC; X_AB * p_B = p_A.
struct Pose {
  Vec3 p;
  Quat q;
};

inline Pose operator*(const Pose& a, const Pose& b) {
  return {a.p + rotate(a.q, b.p), normalized(a.q * b.q)};
}
inline Vec3 operator*(const Pose& a, Vec3 p) { return a.p + rotate(a.q, p); }
inline Pose inverse(const Pose& a) {
  const Quat q = conjugate(a.q);
  return {-rotate(q, a.p), q};
}
// From MuJoCo's xpos/xmat pair; `mat` is row-major.
Pose pose_from_mat(const double* pos, const double* mat);

// Writes x y z, then the quaternion w x y z.
template <class T>
void write_pose(const Pose& pose, T* out) {
  const double values[7] = {pose.p.x, pose.p.y, pose.p.z, pose.q.w, pose.q.x, pose.q.y, pose.q.z};
  for (int i = 0; i < 7; ++i) out[i] = static_cast<T>(values[i]);
}

// A body-frame twist: linear part first (m), then angular (rad), as used by exp6/log6.
struct Twist {
  Vec3 v, w;
};

inline Twist operator*(double s, const Twist& t) { return {s * t.v, s * t.w}; }
inline double norm(const Twist& t) { return std::sqrt(dot(t.v, t.v) + dot(t.w, t.w)); }

// Screw motion for unit time, and its inverse: exp6(log6(X)) = X for rotations below pi. log6: w is
// the rotation vector; v = V^-1 p, V = I + (1-cos a)/a^2 [w] + (a - sin a)/a^3 [w]^2, a = |w|; for
// a < 1e-6, v = p.
Pose exp6(const Twist& twist);
Twist log6(const Pose& pose);

}  // namespace mjsense
