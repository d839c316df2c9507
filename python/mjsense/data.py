"""What sensors with several fields return. All arrays are float32 unless said otherwise, [B, ...], and share memory with the
sensor: they hold the values of the moment of the last read of ``.data``, and are read-only. Fields that were not asked for are
None."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from mjsense._field_docs import show_field_docs


@dataclass(slots=True, frozen=True)
class SensorData:
    """Base: the fields of a sensor that is none of the kinds below."""

    def __repr__(self) -> str:
        shown = ", ".join(
            f"{f.name}={getattr(self, f.name).dtype}{list(getattr(self, f.name).shape)}"
            for f in fields(self)
            if getattr(self, f.name) is not None
        )
        return f"{type(self).__name__}({shown})"


@dataclass(slots=True, repr=False, frozen=True)
class ContactData(SensorData):
    """Contacts of ``P`` primaries with ``S`` slots each; column ``p * S + s``, ``N = P * S``. A slot without contact is zero.

    Force is what the primary exerts on the secondary; normals point from the primary to the secondary.
    """

    found: np.ndarray | None = None
    """[B, N] number of contacts that matched, the same in every filled slot; 0: none."""
    force: np.ndarray | None = None
    """[B, N, 3] N. Contact frame (x = normal, force[0] >= 0); world frame with global_frame or netforce."""
    torque: np.ndarray | None = None
    """[B, N, 3] N m, in the frame of force."""
    dist: np.ndarray | None = None
    """[B, N] m, negative in penetration."""
    pos: np.ndarray | None = None
    """[B, N, 3] m, world."""
    normal: np.ndarray | None = None
    """[B, N, 3] unit, world."""
    tangent: np.ndarray | None = None
    """[B, N, 3] unit, world."""
    current_air_time: np.ndarray | None = None
    """[B, P] s since the last contact; 0 in contact."""
    last_air_time: np.ndarray | None = None
    """[B, P] s, of the last flight, the landing substep included."""
    current_contact_time: np.ndarray | None = None
    """[B, P] s since the contact began; 0 in the air."""
    last_contact_time: np.ndarray | None = None
    """[B, P] s, of the last contact, the take-off substep included."""
    force_history: np.ndarray | None = None
    """[B, N, H, 3] N, newest first, one entry a substep."""
    torque_history: np.ndarray | None = None
    """[B, N, H, 3] N m."""
    dist_history: np.ndarray | None = None
    """[B, N, H] m."""
    found_history: np.ndarray | None = None
    """[B, N, H]."""
    pos_history: np.ndarray | None = None
    """[B, N, H, 3] m."""
    normal_history: np.ndarray | None = None
    """[B, N, H, 3]."""
    tangent_history: np.ndarray | None = None
    """[B, N, H, 3]."""
    touchdown: np.ndarray | None = None
    """[B, P] bool, a contact began in this control step."""
    liftoff: np.ndarray | None = None
    """[B, P] bool, a contact ended in this control step."""
    found_any: np.ndarray | None = None
    """[B, P] bool, any contact in this control step."""
    force_peak: np.ndarray | None = None
    """[B, P, 3] N, the strongest of the control step."""
    dist_at_peak: np.ndarray | None = None
    """[B, P] m."""
    pos_at_peak: np.ndarray | None = None
    """[B, P, 3] m."""
    first_touch_time: np.ndarray | None = None
    """[B, P] s from the start of the control step to its first substep with contact; -1: none."""
    normal_force: np.ndarray | None = None
    """[B, N, 3] N, part of force along the normal."""
    friction_force: np.ndarray | None = None
    """[B, N, 3] N, the rest of force."""
    other_geom: np.ndarray | None = None
    """[B, N] int32, MuJoCo id of the other side; -1: none."""
    other_body: np.ndarray | None = None
    """[B, N] int32."""
    pair_found: np.ndarray | None = None
    """[B, P, S] with secondary_policy "each": contacts of each primary with each secondary."""
    pair_force: np.ndarray | None = None
    """[B, P, S, 3] N, world, primary on secondary."""


@dataclass(slots=True, repr=False, frozen=True)
class RayCastData(SensorData):
    """Hits of ``R = F * n`` rays, frame by frame."""

    distances: np.ndarray | None = None
    """[B, R] m along the ray; -1: nothing within max_distance."""
    hit_pos_w: np.ndarray | None = None
    """[B, R, 3] m, world; the ray's origin on a miss."""
    normals_w: np.ndarray | None = None
    """[B, R, 3] unit, world, outward; 0 on a miss."""
    frame_pos_w: np.ndarray | None = None
    """[B, F, 3] m, world."""
    frame_quat_w: np.ndarray | None = None
    """[B, F, 4] of the physical frame, not the aligned one."""
    pos_w: np.ndarray | None = None
    """[B, 3] m, of frame 0."""
    quat_w: np.ndarray | None = None
    """[B, 4] of frame 0."""
    geom_id: np.ndarray | None = None
    """[B, R] int32, geom that was hit; -1: none; beyond the geoms: flexes."""
    body_id: np.ndarray | None = None
    """[B, R] int32; -1: none."""
    material_id: np.ndarray | None = None
    """[B, R] int32; -1: none."""
    heights: np.ndarray | None = None
    """Terrain height sensors: [B, F] m, [B, F, n] without reduction."""
    points: np.ndarray | None = None
    """Lidars: [B, R, 3] m, sensor frame; 0 without a return."""
    intensity: np.ndarray | None = None
    """Lidars: [B, R] 0..1."""


@dataclass(slots=True, repr=False, frozen=True)
class CameraData(SensorData):
    """Images; row 0 is the top."""

    rgb: np.ndarray | None = None
    """[B, H, W, 3] uint8."""
    depth: np.ndarray | None = None
    """[B, H, W, 1] m, distance to the camera plane (depth_kind "ray": along the ray); 0: background."""
    segmentation: np.ndarray | None = None
    """[B, H, W, 2] int32: (geom id, 5); (-1, -1): background."""
    body_segmentation: np.ndarray | None = None
    """[B, H, W, 1] int32 body id; -1: background, flexes, skins."""
    entity_segmentation: np.ndarray | None = None
    """[B, H, W, 1] int32 place in ``list(scene.entities)``; -1: background, or no entity's."""
    normals: np.ndarray | None = None
    """[B, H, W, 3] unit, outward, camera frame; 0: background."""
    point_cloud: np.ndarray | None = None
    """[B, H, W, 3] m, camera frame; NaN: background."""
    flow: np.ndarray | None = None
    """[B, H, W, 2] pixels: where what a pixel sees was in the previous image, minus where it is (u right, v down); NaN: background."""
    intrinsics: np.ndarray | None = None
    """[B, 3, 3] pixels, OpenCV: x right, y down, z forward; pixel centres at +0.5."""
    pose: np.ndarray | None = None
    """[B, 4, 4] of MuJoCo's camera frame (x right, y up, looks along -z) in the world, when the image was taken."""


def make_data(base: type, arrays: dict[str, np.ndarray]) -> Any:
    """An instance of `base` with these fields; fields that it does not name are added in a class of their own."""
    known = {f.name for f in fields(base)}
    extra = [name for name in arrays if name not in known]
    if extra:
        namespace = {"__annotations__": {name: "np.ndarray | None" for name in extra}, **dict.fromkeys(extra)}
        base = dataclass(repr=False, frozen=True)(type(base.__name__, (base,), namespace))
    return base(**arrays)


show_field_docs(__name__)
