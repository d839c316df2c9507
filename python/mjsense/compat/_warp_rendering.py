# SPDX-License-Identifier: Apache-2.0
"""The settings of a ``mujoco_warp.RenderContext``, and whether mjsense draws its images."""

from __future__ import annotations

from typing import Any

import numpy as np

_LIGHTS = 31
"""Active lights of a model, besides the headlight, that mjsense draws."""

_ON = ("use_ambient_lighting", "enable_backface_culling", "enable_specular", "enable_emission", "enable_per_light_ambient")
"""Settings that mjsense draws only with mujoco_warp's defaults."""


def reason_to_leave(model: Any, source: Any, rc: Any) -> str:
    """Why images of this context are mujoco_warp's own; empty if mjsense draws them. `source`: the ``MjModel``."""
    if getattr(rc, "samples_per_pixel", 1) > 1:
        return "a pixel has several samples"
    off = [name for name in _ON if not getattr(rc, name, True)]
    if off:
        return f"{off[0]} is False"
    if max([*rc.enabled_geom_ids.numpy(), -1]) >= source.ngeom or max(rc.cam_id_map.numpy()) >= source.ncam:
        raise ValueError("render(): the render context belongs to another model: it has geoms or cameras that the model lacks")
    if model.nflex:
        return "the model has flexes"
    if getattr(rc, "splat_count", 0):
        return "it has splats"
    if model.nlight > _LIGHTS:
        return f"the model has more than {_LIGHTS} lights"
    if any(source.cam_projection[rc.cam_id_map.numpy()]):
        return "a camera is orthographic"
    head = source.vis.headlight
    colors = [(rc.headlight_ambient, head.ambient), (rc.headlight_diffuse, head.diffuse), (rc.headlight_specular, head.specular)]
    if bool(head.active) != rc.headlight_active or any(not np.allclose([*a], b, atol=1e-6) for a, b in colors):
        return "its headlight is not that of the model"
    drawn, groups = rc.enabled_geom_ids.numpy(), geom_groups(source, rc)
    if not np.array_equal(np.sort(drawn), np.flatnonzero(np.isin(source.geom_group, groups))):
        return "its geoms are not those of whole groups"
    return ""


def look_of(rc: Any) -> tuple[bool, bool, float]:
    """Whether the context is that of mujoco_warp 4.0, whether meshes have vertex normals, and the share of light in shadows."""
    series_4 = hasattr(rc, "shadow_light_fraction")
    return series_4, series_4 and bool(rc.enable_vertex_normals), float(getattr(rc, "shadow_light_fraction", 0.3))


def geom_groups(source: Any, rc: Any) -> list[int]:
    """The groups of the geoms that the context shows."""
    return sorted({int(group) for group in source.geom_group[rc.enabled_geom_ids.numpy()]})


def cameras_of(rc: Any) -> list[tuple[int, int, int, tuple[float, ...] | None, tuple[int, int, int]]]:
    """The arguments of ``ForeignArrays.render``."""
    found, first = [], 0
    wanted = [(name, *(getattr(rc, part.format(name)) for part in ("{}_data", "{}_adr", "render_{}"))) for name in _KINDS]
    rays = rc.ray.numpy() if rc.use_precomputed_rays else None
    for index, (camera, (width, height)) in enumerate(zip(rc.cam_id_map.numpy().tolist(), rc.cam_res.numpy().tolist())):
        pixels = None if rays is None else _pixels(rays[first : first + width * height], width, height)
        arrays = [_place(data, places, on, index, width * height, name) for name, data, places, on in wanted]
        if any(arrays):
            found.append((camera, width, height, pixels, tuple(arrays)))
        first += width * height
    return found


_KINDS = ("rgb", "depth", "seg")


def _place(data: Any, places: Any, on: Any, index: int, pixels: int, name: str) -> int:
    """The address of the images of a camera in world 0; 0 if they are not wanted."""
    if not on.numpy()[index]:
        return 0
    place = int(places.numpy()[index])
    if place < 0 or place + pixels > data.shape[1]:
        raise ValueError(
            f"render(): {name}_data of the render context has {data.shape[1]} pixels for each world, and camera {index} of it "
            f"needs those from {place} to {place + pixels}"
        )
    return data.ptr + place * data.strides[-1]


def row_lengths(rc: Any) -> tuple[int, int, int]:
    """Numbers from one world to the next in rgb, depth and segmentation."""
    rgb, depth, segmentation = (getattr(rc, f"{name}_data").strides[0] // 4 for name in _KINDS)
    return rgb, depth, segmentation


def _pixels(rays: np.ndarray, width: int, height: int) -> tuple[float, ...] | None:
    """left, top, dx and dy of rays in the camera's frame; None if there are too few to tell."""
    if width < 2 or height < 2:
        return None
    first, last = (ray[:2].astype(float) / -float(ray[2]) for ray in (rays[0], rays[-1]))
    step = (last - first) / (width - 1, height - 1)
    return (*(first - 0.5 * step).tolist(), *step.tolist())
