// SPDX-License-Identifier: Apache-2.0
#pragma once
// Intersects a packet of rays with a height field, in the height field's frame; used by
// kernels_impl.h. The surface z = h(x, y) has two triangles per cell, split along (row, col) - (row
// + 1, col + 1); below it is a base box. Each lane walks over the cells under its ray, skips blocks
// of cells that the ray passes above, and looks for a change of sign of z - h. Neighbouring cells
// share the values at their border, so no ray slips through a seam.
//
// The side of the surface on which a ray is follows from its path so far. The sign of z - h is used
// only if nothing else decides, because where the surface is flat and coincides with the top face
// of the bounding box, through which rays enter and leave, that sign is a rounding error. For the
// same reason the border is never tested against cell coordinates, which would be ambiguous for a
// ray in the border's plane: only the bounding box decides when a ray leaves the field, and until
// then the ray stays in the cells along the border.

#include <mujoco/mujoco.h>

#include "mjsense/core/simd.h"
#include "mjsense/rays/analytic_shapes.h"
#include "mjsense/rays/embree.h"
#include "mjsense/rays/kernels.h"
#include "mjsense/rays/packet.h"

namespace mjsense::rays {
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

// Height above the cell (x0, y0) at grid coordinates (x, y); h_yx are the heights of its corners.
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
  Int prim(const HeightField& field, Mask first) const {
    return (truncate(y0) * int_of(field.cols - 1) + truncate(x0)) * int_of(2) +
           select(first, int_of(0), int_of(1));
  }
  // Slope per cell of the triangle that contains (x, y): the `first` one has the corner (0, 1), the
  // other has (1, 0).
  Float slope_x(Mask first) const { return select(first, h01 - h00, h11 - h10); }
  Float slope_y(Mask first) const { return select(first, h11 - h01, h10 - h00); }
  Float height(Float x, Float y) const {
    const Float fx = x - x0, fy = y - y0;
    const Mask first = fy <= fx;
    return fma(slope_x(first), fx, fma(slope_y(first), fy, h00));
  }
};

// The cell that contains a point, or the nearest cell if the point is outside the grid.
struct FieldPoint {
  Float x, y;  // grid coordinates
  Cell cell;

  FieldPoint(const HeightField& field, Vec3f p)
      : x(grid(p.x, field.size[0], field.cols)),
        y(grid(p.y, field.size[1], field.rows)),
        cell(field, truncate(min(floor(x), static_cast<float>(field.cols - 2))),
             truncate(min(floor(y), static_cast<float>(field.rows - 2)))) {}
  Int prim(const HeightField& field) const { return cell.prim(field, y - cell.y0 <= x - cell.x0); }

 private:
  static Float grid(Float x, float half, int points) {
    const float last = static_cast<float>(points - 1);
    return min(max((x + half) * (last / (2 * half)), 0.0f), last);
  }
};

// A ray over the grid: x and y in grid coordinates (columns, rows), z in local height. t counts
// from `start`.
struct GridRay {
  Float x, y, z;     // values at t = 0
  Float dx, dy, dz;  // change per metre
  Float length;      // m
  Mask right, up, still_x, still_y;
  Float inv_x, inv_y;
  Float columns, rows;  // column and row of the far borders

  GridRay(const HeightField& field, Vec3f o, Vec3f d, Float start, Float stop) {
    const float per_x = (field.cols - 1) / (2 * field.size[0]);
    const float per_y = (field.rows - 1) / (2 * field.size[1]);
    const Vec3f p = along(o, start, d);
    columns = static_cast<float>(field.cols - 1);
    rows = static_cast<float>(field.rows - 1);
    x = min(max((p.x + field.size[0]) * per_x, 0.0f), columns);
    y = min(max((p.y + field.size[1]) * per_y, 0.0f), rows);
    z = p.z;
    dx = d.x * per_x;
    dy = d.y * per_y;
    dz = d.z;
    length = stop - start;
    right = dx > Float(0.0f);
    up = dy > Float(0.0f);
    still_x = abs(dx) < Float(1e-20f);
    still_y = abs(dy) < Float(1e-20f);
    inv_x = Float(1.0f) / dx;
    inv_y = Float(1.0f) / dy;
  }
  Float x_at(Float t) const { return fma(t, dx, x); }
  Float y_at(Float t) const { return fma(t, dy, y); }
  Float z_at(Float t) const { return fma(t, dz, z); }
  // Distance at which the ray crosses the line at this column or row; kNoHit for the grid's
  // borders.
  Float reaches_x(Float column) const {
    const Mask border = (column <= Float(0.0f)) | (column >= columns);
    return select(still_x | border, kNoHit, (column - x) * inv_x);
  }
  Float reaches_y(Float row) const {
    const Mask border = (row <= Float(0.0f)) | (row >= rows);
    return select(still_y | border, kNoHit, (row - y) * inv_y);
  }
};

// State of the walk in each lane: the current cell, and the distance at which the ray entered it.
struct Walk {
  Float cx, cy, t;
  Float side;  // side of the surface: 1 above, -1 below, 0 not known yet
  Mask active;
  Mask fresh;  // entered by a leap: the height above the surface at t is not known

  // Keeps finished lanes from reading outside the grid.
  void stay_inside(const HeightField& field) {
    cx = min(max(cx, 0.0f), static_cast<float>(field.cols - 2));
    cy = min(max(cy, 0.0f), static_cast<float>(field.rows - 2));
  }

  // Lanes whose ray passes above all of its block leap to the block's border. Returns these lanes.
  Mask skip_block(const HeightField& field, const GridRay& ray) {
    constexpr float kBlock = HeightField::kBlock;
    const Float bx = floor(cx * (1 / kBlock)), by = floor(cy * (1 / kBlock));
    const Float top =
        gather(field.block_tops, truncate(by) * int_of(field.block_cols) + truncate(bx));
    const Float low_x = bx * kBlock, low_y = by * kBlock;
    const Float edge_x = low_x + select(ray.right, kBlock, 0.0f);
    const Float edge_y = low_y + select(ray.up, kBlock, 0.0f);
    const Float out_x = ray.reaches_x(edge_x), out_y = ray.reaches_y(edge_y);
    const Float out = max(t, min(ray.length, min(out_x, out_y)));
    const Mask above = active & (min(ray.z_at(t), ray.z_at(out)) > top);
    if (!any(above)) return above;
    const Mask sideways = out_x <= out_y;
    // The last block along each axis may have fewer cells; clamp to those that exist.
    const Float high_x = min(low_x + (kBlock - 1), static_cast<float>(field.cols - 2));
    const Float high_y = min(low_y + (kBlock - 1), static_cast<float>(field.rows - 2));
    const Float within_x = min(max(floor(ray.x_at(out)), low_x), high_x);
    const Float within_y = min(max(floor(ray.y_at(out)), low_y), high_y);
    const Float next_x = select(sideways, select(ray.right, edge_x, edge_x - 1.0f), within_x);
    const Float next_y = select(sideways, within_y, select(ray.up, edge_y, edge_y - 1.0f));
    cx = select(above, next_x, cx);
    cy = select(above, next_y, cy);
    t = select(above, out, t);
    side = select(above, 1.0f, side);
    fresh = fresh | above;
    active = active & ~(above & (out >= ray.length));
    stay_inside(field);
    return above;
  }
};

// Finds the surface between `start` and `stop` in each active lane; the rays start on this `side`
// of it. Returns the side on which each ray ends.
inline Float march(const HeightField& field, Vec3f o, Vec3f d, Float start, Float stop, Float side,
                   Mask active, bool cull, FieldHit& hit) {
  const GridRay ray(field, o, d, start, stop);
  const float per_x = (field.cols - 1) / (2 * field.size[0]);
  const float per_y = (field.rows - 1) / (2 * field.size[1]);
  const Float diagonal = ray.dy - ray.dx, inv_diagonal = Float(1.0f) / diagonal;
  const Mask still_diagonal = abs(diagonal) < Float(1e-20f);
  Walk walk{floor(ray.x), floor(ray.y), 0.0f, side, active, mask_of(kAllLanes)};
  walk.stay_inside(field);
  // Leaps are worth their cost only if rays cross many cells.
  const bool far =
      any(active & (ray.length * (abs(ray.dx) + abs(ray.dy)) > Float(HeightField::kBlock)));
  // A ray that leaves through the border of the surface hits it in spite of rounding, because a
  // neighbouring field may have a higher id.
  const Float at_border = tied(stop) - stop;
  Float fa = 0.0f;  // height above the surface at walk.t; 0 or of the same sign as walk.side
  while (any(walk.active)) {
    const Mask leapt = far ? walk.skip_block(field, ray) : mask_of(0);
    const Mask here = walk.active & ~leapt;
    if (!any(here)) continue;
    const Int ix = truncate(walk.cx), iy = truncate(walk.cy);
    const Cell cell(field, ix, iy);
    const Float ta = walk.t;
    const Mask fresh = walk.fresh & here;
    if (any(fresh)) {
      const Float f = ray.z_at(ta) - cell.height(ray.x_at(ta), ray.y_at(ta));
      const Mask unknown = fresh & (abs(walk.side) < Float(0.5f));
      walk.side = select(unknown, select(f < Float(0.0f), -1.0f, 1.0f), walk.side);
      fa = select(fresh, select(walk.side < Float(0.0f), min(f, 0.0f), max(f, 0.0f)), fa);
      walk.fresh = walk.fresh & ~fresh;
    }
    const Float next_x = ray.reaches_x(walk.cx + select(ray.right, 1.0f, 0.0f));
    const Float next_y = ray.reaches_y(walk.cy + select(ray.up, 1.0f, 0.0f));
    const Float tb = max(ta, min(ray.length, min(next_x, next_y)));
    // Inside the cell the ray may change triangles, where x - x0 = y - y0.
    const Float td = ((ray.x - walk.cx) - (ray.y - walk.cy)) * inv_diagonal;
    const Float tm = select(still_diagonal | ~(td > ta) | ~(td < tb), tb, td);
    Mask open = here;
    for (int part = 0; part < 2; ++part) {
      const Float t0 = part == 0 ? ta : tm, t1 = part == 0 ? tm : tb;
      const Float fb = ray.z_at(t1) - cell.height(ray.x_at(t1), ray.y_at(t1));
      const Mask crossing = open & (fb * walk.side <= select(t1 >= ray.length, at_border, 0.0f)) &
                            (part == 0 ? mask_of(kAllLanes) : tm < tb);
      if (any(crossing)) {
        const Float drop = fa - fb;
        const Float t =
            min(t0 + (t1 - t0) * select(abs(drop) > Float(1e-30f), fa / drop, 0.0f), t1);
        const Float middle = (t0 + t1) * 0.5f;
        const Mask first = ray.y_at(middle) - walk.cy <= ray.x_at(middle) - walk.cx;
        const Vec3f n = Sphere::normal(
            nullptr, {-cell.slope_x(first) * per_x, -cell.slope_y(first) * per_y, 1.0f});
        const Mask seen = cull ? crossing & (walk.side > Float(0.0f)) : crossing;
        take(hit, seen, start + t, cell.prim(field, first), n);
        open = open & ~seen;
        walk.active = walk.active & ~seen;
        walk.side = select(crossing, -walk.side, walk.side);
      }
      fa = select(here, fb, fa);
    }
    const Mask sideways = next_x <= next_y;
    walk.cx = select(here & sideways, walk.cx + select(ray.right, 1.0f, -1.0f), walk.cx);
    walk.cy = select(here & ~sideways, walk.cy + select(ray.up, 1.0f, -1.0f), walk.cy);
    walk.active = walk.active & (leapt | (tb < ray.length));
    walk.stay_inside(field);
    walk.t = select(here, tb, walk.t);
  }
  return walk.side;
}

inline FieldHit intersect_height_field(const HeightField& field, Vec3f o, Vec3f d, Float limit,
                                       bool cull) {
  FieldHit hit = {kNoHit, int_of(-1), {0.0f, 0.0f, 0.0f}};
  const float base[3] = {field.size[0], field.size[1], 0.5f * field.size[3]};
  const Vec3f ob = {o.x, o.y, o.z + base[2]};
  const Float t_base = Box::intersect(base, ob, d, cull);
  if (any(t_base < Float(kNoHit)))
    take(hit, t_base < Float(kNoHit), t_base, int_of(-1), Box::normal(base, along(ob, t_base, d)));

  const float top[3] = {field.size[0], field.size[1], 0.5f * field.lid};
  const Vec3f ot = {o.x, o.y, o.z - top[2]};
  const Interval level = slab(top[2], ot.z, d.z);
  Interval in = Box::interval(top, ot, d);
  const Mask meets = in.enter <= tied(in.leave);
  in.leave = max(in.leave, in.enter);  // through an edge, where rounding has exchanged them
  const Float start = max(in.enter, 0.0f), stop = min(in.leave, limit);
  Mask active = meets & (in.leave >= Float(0.0f)) & (start <= stop);
  if (!any(active)) return hit;

  // A ray that enters through a side face, at or below the surface, hits the side wall there.
  const Mask entering = active & (in.enter >= Float(0.0f));
  const Mask from_base = (d.z > Float(0.0f)) & (level.enter >= in.enter);
  const Mask through_side = entering & (level.enter < in.enter);
  if (any(through_side)) {
    const Vec3f p = along(ot, in.enter, d);
    const FieldPoint at(field, p);
    const Mask wall = through_side & (p.z + top[2] <= at.cell.height(at.x, at.y));
    take(hit, wall, in.enter, int_of(-1), Box::normal(top, p));
    active = active & ~wall;
  }
  const Float side = select(entering, select(from_base, -1.0f, 1.0f), 0.0f);
  const Float end = march(field, o, d, start, min(stop, hit.t), side, active, cull, hit);

  // A ray that is still below the surface at the end exits the field: through a side wall, or
  // through the top face where the surface touches it.
  const Mask into_base = (d.z < Float(0.0f)) & (level.leave <= in.leave);
  const Mask out = active & (end < Float(0.0f)) & (in.leave <= limit) & ~into_base;
  if (!cull && any(out)) {
    const Vec3f p = along(ot, in.leave, d);
    const FieldPoint at(field, p);
    const Mask upwards = (d.z > Float(0.0f)) & (level.leave <= in.leave);
    const Vec3f wall = Box::normal(top, p);
    const Vec3f n = {select(upwards, 0.0f, wall.x), select(upwards, 0.0f, wall.y),
                     select(upwards, 1.0f, wall.z)};
    take(hit, out, in.leave, select(upwards, at.prim(field), int_of(-1)), n);
  }
  return hit;
}

}  // namespace
}  // namespace mjsense::rays
