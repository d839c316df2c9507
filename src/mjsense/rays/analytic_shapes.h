// SPDX-License-Identifier: Apache-2.0
#pragma once
// Ray intersection with analytic shapes in their own frame, for kernels_impl.h. intersect() returns
// the distance along unit directions, or kNoHit: the entry into the solid if it is ahead of the
// origin, else the exit (never with `cull`). normal() returns the outward normal at a point of the
// surface.

#include "mjsense/core/simd.h"
#include "mjsense/rays/packet.h"

namespace mjsense::rays {
namespace {

struct Interval {
  Float enter, leave;  // interval on the whole line; empty if enter > leave
};

// The largest t that is a tie with t: distances differ by rounding when a ray meets the border of two
// geoms.
inline Float tied(Float t) { return t + fma(abs(t), 4e-7f, 1e-7f); }

inline Float first_ahead(Interval in, Mask hit, bool cull) {
  const Mask ahead = in.enter >= Float(0.0f);
  const Float exit =
      cull ? Float(kNoHit) : select(in.leave >= Float(0.0f), in.leave, Float(kNoHit));
  return select(hit, select(ahead, in.enter, exit), Float(kNoHit));
}

// The part of a line (|d| > 0) between -s and s. If the line is parallel to the slab, it is
// everything or nothing; lines outside by a rounding error are inside, so that none passes between
// two neighbours.
inline Interval slab(Float s, Float o, Float d) {
  const Float inverse = Float(1.0f) / d;
  const Float a = (-s - o) * inverse, b = (s - o) * inverse;
  const Mask parallel = abs(d) < Float(1e-12f);
  const Float inside = select(abs(o) <= s + (abs(o) + s) * 4e-7f, Float(kNoHit), Float(-kNoHit));
  return {select(parallel, -inside, min(a, b)), select(parallel, inside, max(a, b))};
}

struct Plane {
  static Float intersect(const float* size, Vec3f o, Vec3f d, bool) {
    const Float t = -o.z / d.z;
    Mask hit = (d.z < Float(-1e-15f)) & (t >= Float(0.0f));
    if (size[0] > 0) hit = hit & (abs(fma(t, d.x, o.x)) <= Float(size[0]));
    if (size[1] > 0) hit = hit & (abs(fma(t, d.y, o.y)) <= Float(size[1]));
    return select(hit, t, Float(kNoHit));
  }
  static Vec3f normal(const float*, Vec3f) { return {0.0f, 0.0f, 1.0f}; }
};

struct Box {
  static Interval interval(const float* size, Vec3f o, Vec3f d) {
    const Interval x = slab(size[0], o.x, d.x), y = slab(size[1], o.y, d.y),
                   z = slab(size[2], o.z, d.z);
    return {max(x.enter, max(y.enter, z.enter)), min(x.leave, min(y.leave, z.leave))};
  }
  // A ray through an edge hits: rounding must not leave it to a neighbour with a higher id, nor let
  // it pass between two boxes that touch. The distance to a face that is almost parallel to the ray
  // has an error of about 4e-7 (|o| + size) / |d|. Within it, the other faces decide.
  static Float intersect(const float* size, Vec3f o, Vec3f d, bool cull) {
    Interval in = {-kNoHit, kNoHit};      // between all faces
    Interval facing = in, parallel = in;  // `parallel` is enlarged by the error
    const Float os[3] = {o.x, o.y, o.z}, ds[3] = {d.x, d.y, d.z};
    for (int i = 0; i < 3; ++i) {
      const Float c = os[i], slope = select(abs(ds[i]) < Float(1e-12f), 1e-12f, ds[i]);
      const Float inverse = Float(1.0f) / slope, s = size[i];
      const Float a = (-s - c) * inverse, b = (s - c) * inverse;
      const Float enter = min(a, b), leave = max(a, b);
      const Float error = abs(inverse) * ((abs(c) + s) * 4e-7f);
      const Mask is_parallel = abs(slope) < Float(0.25f);
      in = {max(in.enter, enter), min(in.leave, leave)};
      facing.enter = max(facing.enter, select(is_parallel, -kNoHit, enter));
      facing.leave = min(facing.leave, select(is_parallel, kNoHit, leave));
      parallel.enter = max(parallel.enter, select(is_parallel, enter - error, -kNoHit));
      parallel.leave = min(parallel.leave, select(is_parallel, leave + error, kNoHit));
    }
    in.enter = select(parallel.enter > facing.enter, in.enter, facing.enter);
    const Float leave = max(in.leave, min(facing.leave, parallel.leave));
    return first_ahead(in, in.enter <= tied(leave), cull);
  }
  static Vec3f normal(const float* size, Vec3f p) {
    const Float x = abs(abs(p.x) - size[0]), y = abs(abs(p.y) - size[1]),
                z = abs(abs(p.z) - size[2]);
    const Mask is_x = (x <= y) & (x <= z), is_y = ~is_x & (y <= z), is_z = ~is_x & ~is_y;
    return {select(is_x, sign(p.x), 0.0f), select(is_y, sign(p.y), 0.0f),
            select(is_z, sign(p.z), 0.0f)};
  }
  static Float sign(Float x) { return select(x < Float(0.0f), Float(-1.0f), Float(1.0f)); }
};

struct Sphere {
  static Float intersect(const float* size, Vec3f o, Vec3f d, bool cull) {
    const Float middle = -dot(o, d);
    const Vec3f p = along(o, middle, d);
    const Float det = Float(size[0] * size[0]) - dot(p, p);
    const Float half = sqrt(max(det, 0.0f));
    return first_ahead({middle - half, middle + half}, det > Float(0.0f), cull);
  }
  static Vec3f normal(const float*, Vec3f p) {
    const Float s = Float(1.0f) / sqrt(max(dot(p, p), 1e-30f));
    return {p.x * s, p.y * s, p.z * s};
  }
};

struct Ellipsoid {
  static Float intersect(const float* size, Vec3f o, Vec3f d, bool cull) {
    const float s[3] = {1 / size[0], 1 / size[1], 1 / size[2]};
    const Vec3f so = {o.x * s[0], o.y * s[1], o.z * s[2]},
                sd = {d.x * s[0], d.y * s[1], d.z * s[2]};
    const Float a = dot(sd, sd), middle = -dot(so, sd) / a;
    const Vec3f p = along(so, middle, sd);
    const Float det = Float(1.0f) - dot(p, p);
    const Float half = sqrt(max(det, 0.0f) / a);
    return first_ahead({middle - half, middle + half}, det > Float(0.0f), cull);
  }
  static Vec3f normal(const float* size, Vec3f p) {
    const float s[3] = {1 / (size[0] * size[0]), 1 / (size[1] * size[1]), 1 / (size[2] * size[2])};
    return Sphere::normal(size, {p.x * s[0], p.y * s[1], p.z * s[2]});
  }
};

// The infinite tube x^2 + y^2 = r^2. `hit`: lanes whose line meets it. A line parallel to the axis
// and inside the tube stays inside everywhere.
struct Tube {
  Interval in;
  Mask hit;
  Tube(float r, Vec3f o, Vec3f d) {
    const Float a = max(fma(d.x, d.x, d.y * d.y), 1e-20f);
    const Float middle = -fma(o.x, d.x, o.y * d.y) / a;
    const Float x = fma(middle, d.x, o.x), y = fma(middle, d.y, o.y);
    const Float det = Float(r * r) - fma(x, x, y * y);
    const Float half = sqrt(max(det, 0.0f) / a);
    in = {middle - half, middle + half};
    hit = det > Float(0.0f);
  }
};

struct Cylinder {
  static Float intersect(const float* size, Vec3f o, Vec3f d, bool cull) {
    const Float middle = -dot(o, d);
    const Vec3f p = along(o, middle, d);
    const Tube tube(size[0], p, d);
    const Interval caps = slab(size[1], p.z, d.z);
    const Float enter = max(tube.in.enter, caps.enter), leave = min(tube.in.leave, caps.leave);
    return first_ahead({middle + enter, middle + leave}, tube.hit & (enter <= leave), cull);
  }
  static Vec3f normal(const float* size, Vec3f p) {
    const Float rho = sqrt(fma(p.x, p.x, p.y * p.y));
    const Mask cap = abs(abs(p.z) - size[1]) < abs(rho - size[0]);
    const Float s = Float(1.0f) / max(rho, 1e-20f);
    return {select(cap, 0.0f, p.x * s), select(cap, 0.0f, p.y * s),
            select(cap, Box::sign(p.z), 0.0f)};
  }
};

struct Capsule {
  // Moves the end of the tube's interval at t to the ball at that end of the capsule, if it is
  // beyond the straight part. `side`: -1 for the entry, 1 for the exit.
  static Float end(Float t, float side, float r, float h, Vec3f p, Vec3f d, Mask& hit) {
    const Float z = fma(t, d.z, p.z);
    const Mask beyond = abs(z) > Float(h);
    const Vec3f c = {p.x, p.y, p.z - select(z < Float(0.0f), Float(-h), Float(h))};
    const Float middle = -dot(c, d);
    const Vec3f q = along(c, middle, d);
    const Float det = Float(r * r) - dot(q, q);
    hit = hit & (~beyond | (det > Float(0.0f)));
    return select(beyond, fma(sqrt(max(det, 0.0f)), side, middle), t);
  }
  static Float intersect(const float* size, Vec3f o, Vec3f d, bool cull) {
    const Float middle = -dot(o, d);
    const Vec3f p = along(o, middle, d);
    const Tube tube(size[0], p, d);
    Mask hit = tube.hit;
    const Float enter = end(tube.in.enter, -1.0f, size[0], size[1], p, d, hit);
    const Float leave = end(tube.in.leave, 1.0f, size[0], size[1], p, d, hit);
    return first_ahead({middle + enter, middle + leave}, hit, cull);
  }
  static Vec3f normal(const float* size, Vec3f p) {
    const Float h = size[1];
    return Sphere::normal(size, {p.x, p.y, p.z - min(max(p.z, -h), h)});
  }
};

}  // namespace
}  // namespace mjsense::rays
