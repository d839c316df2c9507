// SPDX-License-Identifier: Apache-2.0
#include "mjsense/core/pose.h"

namespace mjsense {
namespace {

constexpr double kSmallAngle = 1e-6;

}  // namespace

Quat quat_from_columns(Vec3 x, Vec3 y, Vec3 z) {
  // Shepperd: divide by the largest of the four components.
  const double trace = x.x + y.y + z.z;
  Quat q;
  if (trace > 0) {
    const double s = 2.0 * std::sqrt(1.0 + trace);
    q = {0.25 * s, (y.z - z.y) / s, (z.x - x.z) / s, (x.y - y.x) / s};
  } else if (x.x >= y.y && x.x >= z.z) {
    const double s = 2.0 * std::sqrt(1.0 + x.x - y.y - z.z);
    q = {(y.z - z.y) / s, 0.25 * s, (y.x + x.y) / s, (z.x + x.z) / s};
  } else if (y.y >= z.z) {
    const double s = 2.0 * std::sqrt(1.0 + y.y - x.x - z.z);
    q = {(z.x - x.z) / s, (y.x + x.y) / s, 0.25 * s, (z.y + y.z) / s};
  } else {
    const double s = 2.0 * std::sqrt(1.0 + z.z - x.x - y.y);
    q = {(x.y - y.x) / s, (z.x + x.z) / s, (z.y + y.z) / s, 0.25 * s};
  }
  return normalized(q);
}

Pose pose_from_mat(const double* pos, const double* mat) {
  return {vec3(pos), quat_from_columns({mat[0], mat[3], mat[6]}, {mat[1], mat[4], mat[7]},
                                       {mat[2], mat[5], mat[8]})};
}

Pose exp6(const Twist& twist) {
  const double a = norm(twist.w);
  if (a < kSmallAngle) return {twist.v, exp3(twist.w)};
  const Vec3 wv = cross(twist.w, twist.v);
  const Vec3 wwv = cross(twist.w, wv);
  const Vec3 p =
      twist.v + ((1.0 - std::cos(a)) / (a * a)) * wv + ((a - std::sin(a)) / (a * a * a)) * wwv;
  return {p, exp3(twist.w)};
}

Twist log6(const Pose& pose) {
  const Vec3 w = log3(pose.q);
  const double a = norm(w);
  if (a < kSmallAngle) return {pose.p, w};
  // V^-1 = I - [w]/2 + c [w]^2, c = 1/a^2 - (1 + cos a)/(2 a sin a). Written with half angles, it
  // stays accurate near pi.
  const double half = 0.5 * a;
  const double c = (1.0 - half * std::cos(half) / std::sin(half)) / (a * a);
  const Vec3 wp = cross(w, pose.p);
  return {pose.p - 0.5 * wp + c * cross(w, wp), w};
}

}  // namespace mjsense
