# SPDX-License-Identifier: Apache-2.0
"""Cameras, drawn by mujoco_warp's renderer."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import mujoco_warp as mjw
import numpy as np
import warp as wp

from mjsense.core import mujoco_names
from mjsense.warp.camera_normals import CameraNormals
from mjsense.warp.sensor import WarpSensor, Worlds, declared, implements, unsupported

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor

wp.set_module_options({"enable_backward": False})

_OBJ_GEOM = wp.constant(5)  # mjOBJ_GEOM


@wp.kernel
def _find_due(
    substep: wp.array(dtype=wp.int64),
    first: wp.array(dtype=bool),
    physics_dt: wp.float64,
    period: wp.float64,
    phase: wp.float64,
    number: wp.array(dtype=wp.int64),
    due: wp.array(dtype=bool),
):
    """Image n is due from phase + n * period on; the first one is also due before that, and at a reset."""
    w = wp.tid()
    time = wp.float64(substep[w]) * physics_dt
    n = wp.max(wp.int64(-1), wp.int64(wp.floor((time - phase) / period + wp.float64(1.0e-6))))
    due[w] = first[w] or n != number[w]
    number[w] = n


@wp.kernel
def _copy_rgb(due: wp.array(dtype=bool), packed: wp.array2d(dtype=wp.uint32), rgb: wp.array3d(dtype=wp.uint8)):
    w, i = wp.tid()
    if due[w]:
        value = packed[w, i]
        rgb[w, i, 0] = wp.uint8(value >> wp.uint32(16))
        rgb[w, i, 1] = wp.uint8(value >> wp.uint32(8))
        rgb[w, i, 2] = wp.uint8(value)


@wp.kernel
def _copy_depth(
    due: wp.array(dtype=bool),
    planar: wp.array2d(dtype=float),
    direction: wp.array(dtype=wp.vec3),
    offset: wp.array(dtype=wp.vec3),
    along_ray: bool,
    depth: wp.array2d(dtype=float),
    points: wp.array3d(dtype=float),
):
    w, i = wp.tid()
    if not due[w]:
        return
    z = planar[w, i]
    distance = z / -direction[i][2]
    if depth.shape[0] > 0:
        depth[w, i] = wp.where(along_ray, distance, z)
    if points.shape[0] > 0:
        point = offset[i] + distance * direction[i]
        for k in range(3):
            points[w, i, k] = wp.where(z > 0.0, point[k], wp.nan)


@wp.kernel
def _copy_segmentation(
    due: wp.array(dtype=bool),
    found: wp.array2d(dtype=wp.vec2i),
    geom_body: wp.array(dtype=int),
    geom_entity: wp.array(dtype=int),
    segmentation: wp.array3d(dtype=int),
    bodies: wp.array2d(dtype=int),
    entities: wp.array2d(dtype=int),
):
    w, i = wp.tid()
    if not due[w]:
        return
    pair = found[w, i]
    is_geom = pair[1] == _OBJ_GEOM
    if segmentation.shape[0] > 0:
        segmentation[w, i, 0] = pair[0]
        segmentation[w, i, 1] = pair[1]
    if bodies.shape[0] > 0:
        body = int(-1)
        if is_geom:
            body = geom_body[pair[0]]
        bodies[w, i] = body
    if entities.shape[0] > 0:
        entity = int(-1)
        if is_geom:
            entity = geom_entity[pair[0]]
        entities[w, i] = entity


@wp.kernel
def _copy_pose(
    due: wp.array(dtype=bool),
    camera: int,
    pos: wp.array2d(dtype=wp.vec3),
    mat: wp.array2d(dtype=wp.mat33),
    pose: wp.array3d(dtype=float),
):
    w = wp.tid()
    if not due[w]:
        return
    for i in range(3):
        for j in range(3):
            pose[w, i, j] = mat[w, camera][i, j]
        pose[w, i, 3] = pos[w, camera][i]
        pose[w, 3, i] = 0.0
    pose[w, 3, 3] = 1.0


@implements("camera")
class Camera(WarpSensor):
    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        super().__init__(worlds, sensor)
        cfg, model = self.cfg, worlds.compiled.model
        self.check_options()
        if cfg.intrinsics is None and not (cfg.camera_name and cfg.fovy):
            self.fixed_fields = ("cam_fovy", "cam_intrinsic", "cam_sensorsize")
        self.camera = mujoco_names.name2id(model, mujoco_names.Obj.CAMERA, cfg.camera_name or self.name)
        self.fields = declared(worlds, sensor)
        self.pixels = cfg.width * cfg.height
        self._make_context(model)
        worlds.compiled._core.refresh(sensor._handle)
        intrinsics = sensor._handle.arrays()["intrinsics"]  # of the compiled world; it has this configuration's changes
        self.fields["intrinsics"].assign(np.broadcast_to(intrinsics[0], (worlds.num_worlds, 3, 3)))
        self._make_rays(model, intrinsics[0])
        self._make_owners(model)
        self.depth_targets = self._pixels_of("depth"), self._pixels_of("point_cloud", 3)
        self.id_targets = (
            self._pixels_of("segmentation", 2),
            self._pixels_of("body_segmentation"),
            self._pixels_of("entity_segmentation"),
        )
        self.normals = CameraNormals(worlds, self.camera, self.fields["normals"]) if "normals" in self.fields else None
        self.every_step = cfg.update_period > 0
        self.due = wp.full(worlds.num_worlds, True, dtype=bool, device=worlds.device)
        self.number = wp.full(worlds.num_worlds, -1, dtype=wp.int64, device=worlds.device)

    def check_options(self) -> None:
        """Raises ValueError for options that mujoco_warp's renderer does not have."""
        cfg = self.cfg
        missing = {
            "samples > 1": cfg.samples > 1,
            f"shading='{cfg.shading}' (it has classic shading only)": cfg.shading != "classic",
            "distortion": cfg.distortion.model != "none",
            "depth_noise": cfg.depth_noise != "none",
            "renderer='opengl'": cfg.renderer != "rays",
            "near": cfg.near > 0 or cfg.clip_near != "none",
            "far": cfg.far > 0 or cfg.clip_far != "none",
            "enabled_site_groups": bool(cfg.enabled_site_groups),
            "enabled_tendon_groups": bool(cfg.enabled_tendon_groups),
            "orthographic with camera_name": cfg.orthographic and bool(cfg.camera_name),
        }
        missing["data type 'flow'"] = "flow" in cfg.data_types
        for option, used in missing.items():
            if used:
                raise unsupported(self.name, option)

    def _make_context(self, model: Any) -> None:
        cfg, worlds, types = self.cfg, self.worlds, self.cfg.data_types
        with wp.ScopedDevice(worlds.device):
            self.context = mjw.create_render_context(
                model,
                worlds.num_worlds,
                (cfg.width, cfg.height),
                "rgb" in types,
                any(name in types for name in ("depth", "point_cloud", "normals")),
                any(name.endswith("segmentation") or name == "normals" for name in types),
                use_textures=cfg.use_textures,
                use_shadows=cfg.use_shadows,
                use_fast_math=False,
                shadow_light_fraction=0.0,
                enabled_geom_groups=list(cfg.enabled_geom_groups),
                cam_active=[self.camera],
                render_skybox=cfg.use_textures,
            )

    def _make_rays(self, model: Any, k: np.ndarray) -> None:
        """Replaces the renderer's rays by those of the sensor's intrinsic parameters, through the centres of the pixels."""
        if self.cfg.orthographic or model.cam_projection[self.camera]:
            return
        u, v = np.meshgrid(np.arange(self.cfg.width) + 0.5, np.arange(self.cfg.height) + 0.5)
        k = k.astype(float)
        x, y = (u - k[0, 2]) / k[0, 0], (v - k[1, 2]) / k[1, 1]
        directions = np.stack([x, -y, -np.ones_like(x)], axis=-1).reshape(-1, 3)
        self.context.ray.assign((directions / np.linalg.norm(directions, axis=-1, keepdims=True)).astype(np.float32))

    def _make_owners(self, model: Any) -> None:
        entities = list(self.worlds.compiled.scene.entities)
        names = [mujoco_names.id2name(model, mujoco_names.Obj.GEOM, i) or "" for i in range(model.ngeom)]
        owners = np.full(max(model.ngeom, 1), -1)
        for i, entity in enumerate(entities):
            prefix = f"{entity}/"
            for geom, name in enumerate(names):
                if name.startswith(prefix) or (entity == "terrain" and name.startswith("terrain") and "/" not in name):
                    owners[geom] = i
        self.geom_entity = self.worlds.array(owners, int)

    def _pixels_of(self, name: str, *channels: int) -> wp.array:
        """A field as ``[B, pixels]`` or ``[B, pixels, channels]``; an empty array if the sensor does not have it."""
        field = self.fields.get(name)
        if field is None:
            dtype = int if name.endswith("segmentation") else float
            return self.worlds.zeros((0,) * (2 + len(channels)), dtype)
        return field.reshape((self.worlds.num_worlds, self.pixels, *channels))

    def launch(self, kernel: Any, *inputs: Any, dim: Any = None) -> None:
        wp.launch(kernel, dim=dim or (self.worlds.num_worlds, self.pixels), inputs=inputs, device=self.worlds.device)

    def update(self) -> None:
        worlds, context, cfg = self.worlds, self.context, self.cfg
        count, due, data = worlds.num_worlds, self.due, self.worlds.data
        if cfg.update_period > 0:
            times = (worlds.physics_dt, cfg.update_period, cfg.phase)
            self.launch(_find_due, worlds.substep, worlds.first, *times, self.number, due, dim=count)
        with wp.ScopedDevice(worlds.device):
            mjw.refit_bvh(worlds.model, data, context)
            mjw.render(worlds.model, data, context)
        self.launch(_copy_pose, due, self.camera, data.cam_xpos, data.cam_xmat, self.fields["pose"], dim=count)
        if "rgb" in self.fields:
            self.launch(_copy_rgb, due, context.rgb_data, self._pixels_of("rgb", 3))
        if "depth" in self.fields or "point_cloud" in self.fields:
            inputs = [context.depth_data, context.ray, context.ray_offset, cfg.depth_kind == "ray", *self.depth_targets]
            self.launch(_copy_depth, due, *inputs)
        if any(name.endswith("segmentation") for name in self.fields):
            self.launch(_copy_segmentation, due, context.seg_data, worlds.model.geom_bodyid, self.geom_entity, *self.id_targets)
        if self.normals:
            self.normals.update(due, context)
