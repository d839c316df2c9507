# SPDX-License-Identifier: Apache-2.0
"""Ray-cast sensors."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from mjsense.core import mujoco_names
from mjsense.warp.pose_history import Pose, PoseHistory, clear, make_history, pose_at, push
from mjsense.warp.sensor import WarpSensor, Worlds, declared, implements, unsupported, vec3_view
from mjsense.warp.surfaces import Filter, Surfaces, nearest_hit, ray_scene

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor

wp.set_module_options({"enable_backward": False})

_BODY, _SITE, _GEOM, _CAMERA = wp.constant(0), wp.constant(1), wp.constant(2), wp.constant(3)
_BASE, _YAW = wp.constant(0), wp.constant(1)


@wp.struct
class Frames:
    """The frames that rays are attached to: their objects, and the poses of these in all worlds."""

    kind: wp.array(dtype=int)  # [F]
    id: wp.array(dtype=int)  # [F]
    alignment: int
    body_pos: wp.array2d(dtype=wp.vec3)
    body_mat: wp.array2d(dtype=wp.mat33)
    site_pos: wp.array2d(dtype=wp.vec3)
    site_mat: wp.array2d(dtype=wp.mat33)
    geom_pos: wp.array2d(dtype=wp.vec3)
    geom_mat: wp.array2d(dtype=wp.mat33)
    camera_pos: wp.array2d(dtype=wp.vec3)
    camera_mat: wp.array2d(dtype=wp.mat33)
    pos: wp.array2d(dtype=wp.vec3)  # [B, F] result
    align: wp.array2d(dtype=wp.mat33)  # [B, F] result: rotation of offsets and directions


@wp.func
def aligned(alignment: int, m: wp.mat33) -> wp.mat33:
    """The frame's rotation, its heading, or none. The heading is that of the x axis; if that is too short in the xy plane, it
    follows from the y axis, so that the rays of a body on its back still point down."""
    if alignment == _BASE:
        return m
    x = float(1.0)
    y = float(0.0)
    if alignment == _YAW:
        x = m[0, 0]
        y = m[1, 0]
        if wp.sqrt(x * x + y * y) < 0.1:
            x = m[1, 1]
            y = -m[0, 1]
        length = wp.max(wp.sqrt(x * x + y * y), 1.0e-6)
        x /= length
        y /= length
    return wp.mat33(x, -y, 0.0, y, x, 0.0, 0.0, 0.0, 1.0)


@wp.func
def quaternion(m: wp.mat33) -> wp.vec4:
    """wxyz; the largest component is positive."""
    squares = wp.vec4(
        1.0 + m[0, 0] + m[1, 1] + m[2, 2],
        1.0 + m[0, 0] - m[1, 1] - m[2, 2],
        1.0 - m[0, 0] + m[1, 1] - m[2, 2],
        1.0 - m[0, 0] - m[1, 1] + m[2, 2],
    )
    largest = int(0)
    for i in range(1, 4):
        if squares[i] > squares[largest]:
            largest = i
    q = wp.vec4()
    if largest == 0:
        q = wp.vec4(squares[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1])
    elif largest == 1:
        q = wp.vec4(m[2, 1] - m[1, 2], squares[1], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0])
    elif largest == 2:
        q = wp.vec4(m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], squares[2], m[1, 2] + m[2, 1])
    else:
        q = wp.vec4(m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[3])
    return wp.normalize(q)


@wp.func
def _frame_pose(frames: Frames, w: int, f: int) -> Pose:
    kind = frames.kind[f]
    i = frames.id[f]
    pose = Pose()
    if kind == _SITE:
        pose.pos = frames.site_pos[w, i]
        pose.mat = frames.site_mat[w, i]
    elif kind == _GEOM:
        pose.pos = frames.geom_pos[w, i]
        pose.mat = frames.geom_mat[w, i]
    elif kind == _CAMERA:
        pose.pos = frames.camera_pos[w, i]
        pose.mat = frames.camera_mat[w, i]
    else:
        pose.pos = frames.body_pos[w, i]
        pose.mat = frames.body_mat[w, i]
    return pose


@wp.kernel
def _remember_poses(frames: Frames, history: PoseHistory, substep: wp.array(dtype=wp.int64), physics_dt: wp.float64):
    w, f = wp.tid()
    pose = _frame_pose(frames, w, f)
    push(history, w, f, wp.float64(substep[w]) * physics_dt, pose.pos, pose.mat)


@wp.kernel
def _place_frames(
    frames: Frames,
    frame_pos: wp.array2d(dtype=wp.vec3),
    frame_quat: wp.array3d(dtype=float),
    first_pos: wp.array(dtype=wp.vec3),
    first_quat: wp.array2d(dtype=float),
):
    w, f = wp.tid()
    pose = _frame_pose(frames, w, f)
    pos = pose.pos
    mat = pose.mat
    frames.pos[w, f] = pos
    frames.align[w, f] = aligned(frames.alignment, mat)
    q = quaternion(mat)
    frame_pos[w, f] = pos
    for k in range(4):
        frame_quat[w, f, k] = q[k]
    if f == 0:
        first_pos[w] = pos
        for k in range(4):
            first_quat[w, k] = q[k]


@wp.struct
class Rays:
    """The rays of one frame, and what they can hit."""

    offset: wp.array(dtype=wp.vec3)  # [parts * n] m
    direction: wp.array(dtype=wp.vec3)  # [parts * n]
    count: int  # n
    part: wp.array(dtype=int)  # [B] part of the pattern that is cast
    filter: Filter
    nearest: float
    farthest: float
    times: wp.array(dtype=wp.float64)  # [parts * n] s, 0 now, < 0 before; empty: all now
    history: PoseHistory  # if there are times
    substep: wp.array(dtype=wp.int64)  # [B]
    physics_dt: wp.float64


@wp.struct
class WorldRay:
    origin: wp.vec3  # m, world
    direction: wp.vec3


@wp.func
def world_ray(frames: Frames, rays: Rays, w: int, r: int) -> WorldRay:
    """Ray ``r`` of a world, with the frame's pose at the ray's own time."""
    f = r // rays.count
    i = rays.part[w] * rays.count + r % rays.count
    pos = frames.pos[w, f]
    align = frames.align[w, f]
    if rays.history.capacity > 0:
        pose = pose_at(rays.history, w, f, wp.float64(rays.substep[w]) * rays.physics_dt + rays.times[i])
        pos = pose.pos
        align = aligned(frames.alignment, pose.mat)
    ray = WorldRay()
    ray.origin = pos + align @ rays.offset[i]
    ray.direction = align @ rays.direction[i]
    return ray


@wp.struct
class Hits:
    distance: wp.array2d(dtype=float)
    pos: wp.array2d(dtype=wp.vec3)
    normal: wp.array2d(dtype=wp.vec3)
    geom: wp.array2d(dtype=int)
    body: wp.array2d(dtype=int)
    material: wp.array2d(dtype=int)


@wp.kernel
def _cast(surfaces: Surfaces, frames: Frames, rays: Rays, hits: Hits, ids: bool):
    w, r = wp.tid()
    f = r // rays.count
    ray = world_ray(frames, rays, w, r)
    origin = ray.origin
    direction = ray.direction
    # The tolerance avoids that rounding turns a hit at the maximum distance into a miss.
    reach = rays.farthest * (1.0 + 4.0e-7)
    hit = nearest_hit(surfaces, rays.filter, f, w, origin, direction, reach)
    geom = hit.geom
    if hit.t < rays.nearest:
        geom = -1
    material = int(-1)
    body = int(-1)
    distance = float(-1.0)
    normal = wp.vec3()
    pos = origin
    if geom >= 0:
        distance = wp.min(hit.t, rays.farthest)
        normal = hit.normal
        pos = origin + distance * direction
        body = surfaces.body[geom]
        material = surfaces.material[w % surfaces.material.shape[0], geom]
    hits.distance[w, r] = distance
    hits.pos[w, r] = pos
    hits.normal[w, r] = normal
    if ids:
        hits.geom[w, r] = geom
        hits.body[w, r] = body
        hits.material[w, r] = material


def camera_rays(model: Any, camera: int) -> np.ndarray:
    """Directions of a pinhole pattern with the resolution and angles of a camera of the model."""
    width, height = (int(n) for n in model.cam_resolution[camera])
    vertical = math.tan(0.5 * math.radians(model.cam_fovy[camera]))
    horizontal = vertical * width / height
    sensor, focal = model.cam_sensorsize[camera], model.cam_intrinsic[camera][:2]
    if (sensor > 0).all() and (focal > 0).all():
        horizontal, vertical = (float(s) / (2 * float(f)) for s, f in zip(sensor, focal, strict=True))
    u, v = (np.linspace(-1, 1, n) if n > 1 else np.array([-1.0]) for n in (width, height))
    x, y = np.meshgrid(u * horizontal, v * vertical)
    directions = np.stack([x, y, np.full_like(x, -1.0)], axis=-1).reshape(-1, 3)
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


@implements("raycast")
class RayCast(WarpSensor):
    exclude_world = True
    """True if exclude_parent_body also applies to a frame on the world body."""

    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        if worlds.compiled.model.nflex:
            raise unsupported(self.name, "a model with flexes")
        self.fields = declared(worlds, sensor)
        self.scene = ray_scene(worlds)
        frames = self.cfg.frame if isinstance(self.cfg.frame, (list, tuple)) else [self.cfg.frame]
        self.num_frames = len(frames)
        self._make_frames(frames)
        offsets, directions, times, parts = self.pattern()
        self._make_rays(offsets, directions, times, len(directions) // parts)
        self._make_hits()

    def pattern(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
        """Offsets, directions and times of one frame's rays, and the number of equal parts that are cast one after the other."""
        pattern = self.cfg.pattern
        times = np.asarray(getattr(pattern, "times", ()), float)
        if camera := getattr(pattern, "camera_name", None):
            model = self.worlds.compiled.model
            directions = camera_rays(model, mujoco_names.name2id(model, mujoco_names.Obj.CAMERA, camera))
            return np.zeros_like(directions), directions, times, 1
        return *pattern.generate_rays(), times, 1

    def _make_frames(self, refs: Any) -> None:
        worlds, data, model = self.worlds, self.worlds.data, self.worlds.compiled.model
        kinds = {"body": 0, "xbody": 0, "site": 1, "geom": 2, "camera": 3}
        objects = [mujoco_names.Obj.BODY, mujoco_names.Obj.SITE, mujoco_names.Obj.GEOM, mujoco_names.Obj.CAMERA]
        kind = [kinds[ref.type] for ref in refs]
        ids = [mujoco_names.name2id(model, objects[k], ref.full_name) for k, ref in zip(kind, refs, strict=True)]
        owners = [np.arange(model.nbody), model.site_bodyid, model.geom_bodyid, model.cam_bodyid]
        self.bodies = [int(owners[k][i]) for k, i in zip(kind, ids, strict=True)]
        f = self.frames = Frames()
        f.kind, f.id = worlds.array(kind, int), worlds.array(ids, int)
        f.alignment = ["base", "yaw", "world"].index(self.cfg.ray_alignment)
        f.body_pos, f.body_mat, f.site_pos, f.site_mat = data.xpos, data.xmat, data.site_xpos, data.site_xmat
        f.geom_pos, f.geom_mat, f.camera_pos, f.camera_mat = data.geom_xpos, data.geom_xmat, data.cam_xpos, data.cam_xmat
        f.pos = worlds.zeros((worlds.num_worlds, len(refs)), wp.vec3)
        f.align = worlds.zeros((worlds.num_worlds, len(refs)), wp.mat33)

    def _make_rays(self, offsets: np.ndarray, directions: np.ndarray, times: np.ndarray, count: int) -> None:
        worlds, cfg = self.worlds, self.cfg
        groups = range(6) if cfg.include_geom_groups is None else cfg.include_geom_groups
        own = [body if cfg.exclude_parent_body and (body > 0 or self.exclude_world) else -1 for body in self.bodies]
        rays = self.rays = Rays()
        rays.offset, rays.direction = worlds.array(offsets, wp.vec3), worlds.array(directions, wp.vec3)
        rays.count, rays.part = count, worlds.zeros(worlds.num_worlds, int)
        rays.filter = self.scene.filter(groups, own)
        rays.nearest, rays.farthest = cfg.min_distance, min(cfg.max_distance, 1e29)

        rays.times, rays.substep, rays.physics_dt = worlds.array(times, wp.float64), worlds.substep, worlds.physics_dt
        self.wants_substep = self.stores_writes = len(times) > 0
        rays.history = make_history(worlds, self.num_frames, int(-times.min() / worlds.physics_dt + 3) if len(times) else 0)

    def _make_hits(self) -> None:
        fields, hits = self.fields, Hits()
        hits.distance = fields["distances"]
        hits.pos, hits.normal = vec3_view(fields["hit_pos_w"]), vec3_view(fields["normals_w"])
        if "geom_id" in fields:
            hits.geom, hits.body, hits.material = fields["geom_id"], fields["body_id"], fields["material_id"]
        self.hits = hits
        first = [vec3_view(fields["frame_pos_w"]), fields["frame_quat_w"], vec3_view(fields["pos_w"]), fields["quat_w"]]
        self._frame_inputs = [self.frames, *first]

    def launch(self, kernel: Any, dim: Any, *inputs: Any) -> None:
        wp.launch(kernel, dim=dim, inputs=inputs, device=self.worlds.device)

    def substep(self) -> None:
        inputs = [self.frames, self.rays.history, self.worlds.substep, self.worlds.physics_dt]
        self.launch(_remember_poses, (self.worlds.num_worlds, self.num_frames), *inputs)

    def reset(self, mask: wp.array) -> None:
        if self.wants_substep:
            clear(self.rays.history, mask)

    def update(self) -> None:
        worlds = self.worlds.num_worlds
        if self.wants_substep:
            self.substep()
        self.launch(_place_frames, (worlds, self.num_frames), *self._frame_inputs)
        inputs = [self.scene.surfaces, self.frames, self.rays, self.hits, "geom_id" in self.fields]
        self.launch(_cast, (worlds, self.num_frames * self.rays.count), *inputs)
