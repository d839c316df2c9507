# SPDX-License-Identifier: Apache-2.0
"""Intersections of rays with MuJoCo's primitive geoms in their own frame, as in ``rays/analytic_shapes.h``.

``hit_...`` return the distance along a unit direction, or ``NO_HIT``: the entry into the solid if it is ahead of the origin, else
the exit. ``normal_...`` return the outward normal at a point of the surface. Solids are solved from the ray's point nearest to
their centre, so that the numbers are small where precision matters.
"""

from __future__ import annotations

import warp as wp

wp.set_module_options({"enable_backward": False})

NO_HIT = wp.constant(1.0e30)


@wp.func
def tied(t: float) -> float:
    """The largest distance that is a tie with t: distances differ by rounding when a ray meets the border of two geoms."""
    return t + wp.abs(t) * 4.0e-7 + 1.0e-7


@wp.func
def _first_ahead(enter: float, leave: float) -> float:
    if enter >= 0.0:
        return enter
    if leave >= 0.0:
        return leave
    return NO_HIT


@wp.func
def _slab(s: float, o: float, d: float) -> wp.vec2:
    """The part of a line between -s and s; lines outside by a rounding error are inside."""
    if wp.abs(d) < 1.0e-12:
        inside = wp.where(wp.abs(o) <= s + (wp.abs(o) + s) * 4.0e-7, NO_HIT, -NO_HIT)
        return wp.vec2(-inside, inside)
    a = (-s - o) / d
    b = (s - o) / d
    return wp.vec2(wp.min(a, b), wp.max(a, b))


@wp.func
def hit_plane(size: wp.vec3, o: wp.vec3, d: wp.vec3) -> float:
    """From the front only; endless where size is 0."""
    if d[2] >= -1.0e-15:
        return NO_HIT
    t = -o[2] / d[2]
    if t < 0.0:
        return NO_HIT
    if size[0] > 0.0 and wp.abs(o[0] + t * d[0]) > size[0]:
        return NO_HIT
    if size[1] > 0.0 and wp.abs(o[1] + t * d[1]) > size[1]:
        return NO_HIT
    return t


@wp.func
def hit_box(size: wp.vec3, o: wp.vec3, d: wp.vec3) -> float:
    """A ray through an edge hits, so that rounding does not let it pass between two boxes that touch. The distance to a face that
    is almost parallel to the ray has a large error; within it, the other faces decide."""
    enter = -NO_HIT
    leave = NO_HIT
    facing_enter = -NO_HIT
    facing_leave = NO_HIT
    parallel_enter = -NO_HIT
    parallel_leave = NO_HIT
    for i in range(3):
        slope = wp.where(wp.abs(d[i]) < 1.0e-12, 1.0e-12, d[i])
        inverse = 1.0 / slope
        a = (-size[i] - o[i]) * inverse
        b = (size[i] - o[i]) * inverse
        near = wp.min(a, b)
        far = wp.max(a, b)
        enter = wp.max(enter, near)
        leave = wp.min(leave, far)
        if wp.abs(slope) < 0.25:
            error = wp.abs(inverse) * ((wp.abs(o[i]) + size[i]) * 4.0e-7)
            parallel_enter = wp.max(parallel_enter, near - error)
            parallel_leave = wp.min(parallel_leave, far + error)
        else:
            facing_enter = wp.max(facing_enter, near)
            facing_leave = wp.min(facing_leave, far)
    if parallel_enter <= facing_enter:
        enter = facing_enter
    leave = wp.max(leave, wp.min(facing_leave, parallel_leave))
    if enter > tied(leave):
        return NO_HIT
    return _first_ahead(enter, leave)


@wp.func
def _sign(x: float) -> float:
    return wp.where(x < 0.0, -1.0, 1.0)


@wp.func
def normal_box(size: wp.vec3, p: wp.vec3) -> wp.vec3:
    x = wp.abs(wp.abs(p[0]) - size[0])
    y = wp.abs(wp.abs(p[1]) - size[1])
    z = wp.abs(wp.abs(p[2]) - size[2])
    if x <= y and x <= z:
        return wp.vec3(_sign(p[0]), 0.0, 0.0)
    if y <= z:
        return wp.vec3(0.0, _sign(p[1]), 0.0)
    return wp.vec3(0.0, 0.0, _sign(p[2]))


@wp.func
def hit_sphere(size: wp.vec3, o: wp.vec3, d: wp.vec3) -> float:
    middle = -wp.dot(o, d)
    p = o + middle * d
    det = size[0] * size[0] - wp.dot(p, p)
    if det <= 0.0:
        return NO_HIT
    half = wp.sqrt(det)
    return _first_ahead(middle - half, middle + half)


@wp.func
def _unit(p: wp.vec3) -> wp.vec3:
    return p / wp.sqrt(wp.max(wp.dot(p, p), 1.0e-30))


@wp.func
def hit_ellipsoid(size: wp.vec3, o: wp.vec3, d: wp.vec3) -> float:
    so = wp.cw_div(o, size)
    sd = wp.cw_div(d, size)
    a = wp.dot(sd, sd)
    middle = -wp.dot(so, sd) / a
    p = so + middle * sd
    det = 1.0 - wp.dot(p, p)
    if det <= 0.0:
        return NO_HIT
    half = wp.sqrt(det / a)
    return _first_ahead(middle - half, middle + half)


@wp.func
def _tube(r: float, o: wp.vec3, d: wp.vec3) -> wp.vec2:
    """The part of a line inside the endless tube x^2 + y^2 = r^2; empty if the first value is larger."""
    a = wp.max(d[0] * d[0] + d[1] * d[1], 1.0e-20)
    middle = -(o[0] * d[0] + o[1] * d[1]) / a
    x = o[0] + middle * d[0]
    y = o[1] + middle * d[1]
    det = r * r - (x * x + y * y)
    if det <= 0.0:
        return wp.vec2(NO_HIT, -NO_HIT)
    half = wp.sqrt(det / a)
    return wp.vec2(middle - half, middle + half)


@wp.func
def hit_cylinder(size: wp.vec3, o: wp.vec3, d: wp.vec3) -> float:
    middle = -wp.dot(o, d)
    p = o + middle * d
    tube = _tube(size[0], p, d)
    caps = _slab(size[1], p[2], d[2])
    enter = wp.max(tube[0], caps[0])
    leave = wp.min(tube[1], caps[1])
    if enter > leave:
        return NO_HIT
    return _first_ahead(middle + enter, middle + leave)


@wp.func
def normal_cylinder(size: wp.vec3, p: wp.vec3) -> wp.vec3:
    rho = wp.sqrt(p[0] * p[0] + p[1] * p[1])
    if wp.abs(wp.abs(p[2]) - size[1]) < wp.abs(rho - size[0]):
        return wp.vec3(0.0, 0.0, _sign(p[2]))
    s = 1.0 / wp.max(rho, 1.0e-20)
    return wp.vec3(p[0] * s, p[1] * s, 0.0)


@wp.func
def _capsule_end(t: float, side: float, r: float, h: float, p: wp.vec3, d: wp.vec3) -> float:
    """The end of the tube's part at t, moved to the ball at that end of the capsule if it is beyond the straight part."""
    z = p[2] + t * d[2]
    if wp.abs(z) <= h:
        return t
    c = wp.vec3(p[0], p[1], p[2] - wp.where(z < 0.0, -h, h))
    middle = -wp.dot(c, d)
    q = c + middle * d
    det = r * r - wp.dot(q, q)
    if det <= 0.0:
        return NO_HIT
    return middle + side * wp.sqrt(det)


@wp.func
def hit_capsule(size: wp.vec3, o: wp.vec3, d: wp.vec3) -> float:
    middle = -wp.dot(o, d)
    p = o + middle * d
    tube = _tube(size[0], p, d)
    if tube[0] > tube[1]:
        return NO_HIT
    enter = _capsule_end(tube[0], -1.0, size[0], size[1], p, d)
    leave = _capsule_end(tube[1], 1.0, size[0], size[1], p, d)
    if enter == NO_HIT or leave == NO_HIT:
        return NO_HIT
    return _first_ahead(middle + enter, middle + leave)


@wp.func
def normal_capsule(size: wp.vec3, p: wp.vec3) -> wp.vec3:
    return _unit(wp.vec3(p[0], p[1], p[2] - wp.clamp(p[2], -size[1], size[1])))


@wp.func
def normal_ellipsoid(size: wp.vec3, p: wp.vec3) -> wp.vec3:
    return _unit(wp.vec3(p[0] / (size[0] * size[0]), p[1] / (size[1] * size[1]), p[2] / (size[2] * size[2])))


@wp.func
def normal_sphere(p: wp.vec3) -> wp.vec3:
    return _unit(p)
