#pragma once
// A packet against a height field in its own frame, for kernels_impl.h. The surface z = h(x, y) is
// two triangles a cell, split along (row, col) - (row + 1, col + 1); below it stands a base box of
// its own. Each lane walks the cells under its ray and looks for a change of sign of z - h:
// neighbouring cells share their borders' values, so no ray slips through a seam.

#include <mujoco/mujoco.h>

#include "mjsense/rays/embree.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/simd.h"
#include "mjsense/rays/solids.h"

namespace mjsense {
namespace {

struct FieldHit {
  Float t;
  Int prim;
  Vec3f normal;
};

inline void take(FieldHit& hit, Mask m, Float t, Int prim, Vec3f n) {
  m = m & (t < hit.t);
  hit.t = select(m, t, hit.t);
  hit.prim = select(m, prim, hit.prim);
  hit.normal = {select(m, n.x, hit.normal.x), select(m, n.y, hit.normal.y),
                select(m, n.z, hit.normal.z)};
}

// Height above the cell (x0, y0) with corners h_yx at grid coordinates (x, y).
struct Cell {
  Float h00, h01, h10, h11, x0, y0;

  Cell(const HeightField& field, Int ix, Int iy) : x0(to_float(ix)), y0(to_float(iy)) {
    const Int at = iy * int_of(field.cols) + ix;
    const float* data = field.data;
    h00 = gather(data, at) * field.size[2];
    h01 = gather(data + 1, at) * field.size[2];
    h10 = gather(data + field.cols, at) * field.size[2];
    h11 = gather(data + field.cols + 1, at) * field.size[2];
  }
  // Slopes per cell of the triangle that (x, y) lies in: `first` holds (0, 1), the other (1, 0).
  Float slope_x(Mask first) const { return select(first, h01 - h00, h11 - h10); }
  Float slope_y(Mask first) const { return select(first, h11 - h01, h10 - h00); }
  Float height(Float x, Float y) const {
    const Float fx = x - x0, fy = y - y0;
    const Mask first = fy <= fx;
    return fma(slope_x(first), fx, fma(slope_y(first), fy, h00));
  }
};

// The surface between `start` and `stop` on each active lane.
inline void march(const HeightField& field, Vec3f o, Vec3f d, Float start, Float stop, Mask active,
                  bool cull, FieldHit& hit) {
  const float per_x = (field.cols - 1) / (2 * field.size[0]),
              per_y = (field.rows - 1) / (2 * field.size[1]);
  const Vec3f p = along(o, start, d);
  const Float gx = (p.x + field.size[0]) * per_x, gy = (p.y + field.size[1]) * per_y;
  const Float sx = d.x * per_x, sy = d.y * per_y;
  const Float length = stop - start;
  const Mask right = sx > Float(0.0f), up = sy > Float(0.0f);
  const Float step_x = select(right, 1.0f, -1.0f), step_y = select(up, 1.0f, -1.0f);
  const Float last_x = static_cast<float>(field.cols - 2),
              last_y = static_cast<float>(field.rows - 2);
  const Mask still_x = abs(sx) < Float(1e-20f), still_y = abs(sy) < Float(1e-20f),
             still_d = abs(sy - sx) < Float(1e-20f);
  const Float inv_x = Float(1.0f) / sx, inv_y = Float(1.0f) / sy, inv_d = Float(1.0f) / (sy - sx);

  Float cx = min(max(floor(gx), 0.0f), last_x), cy = min(max(floor(gy), 0.0f), last_y);
  Float ta = 0.0f;
  Float fa = 0.0f, side = 0.0f;  // z - h at ta; the sign it had at the start
  bool fresh = true;
  while (any(active)) {
    const Int ix = truncate(cx), iy = truncate(cy);
    const Cell cell(field, ix, iy);
    if (fresh) {
      fa = p.z - cell.height(gx, gy);
      side = select(fa < Float(0.0f), -1.0f, 1.0f);
      fresh = false;
    }
    const Float next_x = select(still_x, kNoHit, (cx + select(right, 1.0f, 0.0f) - gx) * inv_x);
    const Float next_y = select(still_y, kNoHit, (cy + select(up, 1.0f, 0.0f) - gy) * inv_y);
    const Float tb = max(ta, min(length, min(next_x, next_y)));
    // The ray may change triangles inside the cell, where x - x0 = y - y0.
    const Float td = ((gx - cx) - (gy - cy)) * inv_d;
    const Float tm = select(still_d | ~(td > ta) | ~(td < tb), tb, td);
    for (int part = 0; part < 2; ++part) {
      const Float t0 = part == 0 ? ta : tm, t1 = part == 0 ? tm : tb;
      const Float fb = fma(t1, d.z, p.z) - cell.height(fma(t1, sx, gx), fma(t1, sy, gy));
      const Mask crossing =
          active & (fb * side <= Float(0.0f)) & (part == 0 ? mask_of(kAllLanes) : tm < tb);
      if (any(crossing)) {
        const Float drop = fa - fb;
        const Float t = t0 + (t1 - t0) * select(abs(drop) > Float(1e-30f), fa / drop, 0.0f);
        const Float middle = (t0 + t1) * 0.5f;
        const Mask first = fma(middle, sy, gy) - cy <= fma(middle, sx, gx) - cx;
        const Vec3f n = Sphere::normal(
            nullptr, {-cell.slope_x(first) * per_x, -cell.slope_y(first) * per_y, 1.0f});
        const Int prim =
            (iy * int_of(field.cols - 1) + ix) * int_of(2) + select(first, int_of(0), int_of(1));
        const Mask seen = cull ? crossing & (side > Float(0.0f)) : crossing;
        take(hit, seen, start + t, prim, n);
        active = active & ~seen;
        side = select(crossing, -side, side);
      }
      fa = fb;
    }
    const Mask step_in_x = next_x <= next_y;
    cx = select(step_in_x, cx + step_x, cx);
    cy = select(step_in_x, cy, cy + step_y);
    active = active & (tb < length) & (cx >= Float(0.0f)) & (cy >= Float(0.0f)) & (cx <= last_x) &
             (cy <= last_y);
    cx = min(max(cx, 0.0f), last_x);  // lanes that are done must not read outside
    cy = min(max(cy, 0.0f), last_y);
    ta = tb;
  }
}

inline FieldHit intersect_height_field(const HeightField& field, Vec3f o, Vec3f d, Float limit,
                                       bool cull) {
  FieldHit hit = {kNoHit, int_of(-1), {0.0f, 0.0f, 0.0f}};
  const float base[3] = {field.size[0], field.size[1], 0.5f * field.size[3]};
  const Vec3f ob = {o.x, o.y, o.z + base[2]};
  const Float t_base = Box::intersect(base, ob, d, cull);
  if (any(t_base < Float(kNoHit)))
    take(hit, t_base < Float(kNoHit), t_base, int_of(-1), Box::normal(base, along(ob, t_base, d)));

  const float top[3] = {field.size[0], field.size[1], 0.5f * field.size[2]};
  const Vec3f ot = {o.x, o.y, o.z - top[2]};
  const Interval in = Box::interval(top, ot, d);
  const Float start = max(in.enter, 0.0f), stop = min(in.leave, limit);
  const Mask active = (in.enter <= in.leave) & (in.leave >= Float(0.0f)) & (start <= stop);
  if (!any(active)) return hit;

  // Walls: where the ray enters or leaves through a side, below the surface's rim.
  const float last_x = static_cast<float>(field.cols - 1),
              last_y = static_cast<float>(field.rows - 1);
  const float per_x = last_x / (2 * field.size[0]), per_y = last_y / (2 * field.size[1]);
  const Mask entering = active & (in.enter >= Float(0.0f));
  const Mask leaving = active & (in.leave <= limit);
  for (int end = 0; end < 2; ++end) {
    if (end == 1 && cull) break;
    const Float t = end == 0 ? in.enter : in.leave;
    const Mask m = end == 0 ? entering : leaving;
    if (!any(m)) continue;
    const Vec3f p = along(ot, t, d);
    const Vec3f n = Box::normal(top, p);
    const Mask wall = m & (abs(n.z) < Float(0.5f));
    if (!any(wall)) continue;
    const Float gx = min(max((p.x + field.size[0]) * per_x, 0.0f), last_x);
    const Float gy = min(max((p.y + field.size[1]) * per_y, 0.0f), last_y);
    const Float cx = min(floor(gx), last_x - 1), cy = min(floor(gy), last_y - 1);
    const Cell cell(field, truncate(cx), truncate(cy));
    take(hit, wall & (p.z + top[2] <= cell.height(gx, gy)), t, int_of(-1), n);
  }
  march(field, o, d, start, min(stop, hit.t), active, cull, hit);
  return hit;
}

}  // namespace
}  // namespace mjsense
