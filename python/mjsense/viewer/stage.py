# SPDX-License-Identifier: Apache-2.0
"""One world in the browser: meshes sent once, and poses sent when they change."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.viewer import surfaces
from mjsense.viewer.soft import Read, SoftParts
from mjsense.viewer.text import label

VISIBLE_GROUPS = (0, 1, 2)
"""Geom groups that MuJoCo shows by default."""
MIN_REACH = 10.0
"""Half side of planes without an end, at least. [m]"""
_DIRECTIONAL = 1  # mjtLightType
_MAX_SHADOW_MAPS = 6  # a browser binds 16 textures at a time
_MIN_CHANGE = 1e-6  # m, or of a quaternion's components: smaller changes of a pose are not sent


def node(model: Any, kind: str, index: int) -> str:
    """Name of an element without slashes, which separate levels of the browser's scene tree. Names that are too long get the
    element's number."""
    name = getattr(model, kind)(index).name
    shown = label(name)
    return f"{kind}_{index}" if not name else name.replace("/", "|") if shown == name else f"{shown} {index}".replace("/", "|")


class Stage:
    """Draws a model into a viser server."""

    def __init__(self, server: Any) -> None:
        self._server, self._model = server, None
        self._frames: dict[int, Any] = {}
        self._solids: dict[tuple[str, int], tuple[Any, tuple[Any, ...]]] = {}  # by "geom" or "site", and index
        self._soft = SoftParts(server)
        self._lights: list[Any] = []
        self._light_key: bytes = b""
        self._sent = np.zeros((0, 7))
        self.groups: set[int] = set(VISIBLE_GROUPS)
        """Groups that are shown, of geoms, flexes, skins and tendons, and of sites if these are shown."""
        self.sites = False
        """Whether sites are shown."""

    def set_model(self, model: Any) -> None:
        """Shows a model with its sizes, colours and lights. Unchanged geoms are not sent again."""
        with self._server.atomic():
            if self._model is None or self._structure(model) != self._structure(self._model):
                self._clear()
                self._model = model
                self._sent = np.full((model.nbody, 7), np.nan)
            self._model = model
            reach = max(MIN_REACH, 2 * float(model.stat.extent))
            for kind, count, seen in (("geom", model.ngeom, model), ("site", model.nsite, surfaces.SitesAsGeoms(model))):
                for index in range(count):
                    self._set_solid(model, seen, kind, index, reach)
            self._soft.set_model(model, self.groups)
            self._set_lights(model)

    def show(self, read: Read) -> None:
        """Shows the present state of a world."""
        with self._server.atomic():
            self.set_poses(read("xpos"), read("xquat"))
            self._soft.update(read)

    def set_poses(self, positions: np.ndarray, quaternions: np.ndarray) -> int:
        """Moves the bodies. Returns how many poses were sent.

        Args:
            positions: float [nbody, 3] m, world frame.
            quaternions: float [nbody, 4], wxyz.
        """
        poses = np.concatenate([positions, quaternions], axis=1)
        changed = np.flatnonzero(~(np.abs(poses - self._sent) < _MIN_CHANGE).all(1))
        count = 0
        with self._server.atomic():
            for body in changed.tolist():
                frame = self._frames.get(body)
                if frame is not None:
                    frame.position, frame.wxyz = poses[body, :3], poses[body, 3:]
                    count += 1
        self._sent[changed] = poses[changed]
        return count

    def show_groups(self, groups: set[int], sites: bool = False) -> None:
        """Shows what is in these groups, and hides everything else."""
        self.groups, self.sites = groups, sites
        if self._model is not None:
            self.set_model(self._model)

    def _structure(self, model: Any) -> tuple[Any, ...]:
        return model.nbody, model.ngeom, model.nsite, model.nlight, model.geom_bodyid.tobytes(), bytes(model.names)

    def _clear(self) -> None:
        for handle in (*self._lights, *self._frames.values()):  # lights may be below frames
            handle.remove()
        self._frames, self._solids, self._lights, self._light_key = {}, {}, [], b""

    def _frame(self, model: Any, body: int) -> str:
        name = f"/bodies/{node(model, 'body', body)}"
        if body not in self._frames:
            pose = self._sent[body]  # NaN before the first poses
            at = {"position": pose[:3], "wxyz": pose[3:]} if np.isfinite(pose).all() else {}
            self._frames[body] = self._server.scene.add_frame(name, show_axes=False, **at)
        return name

    def _set_solid(self, model: Any, seen: Any, kind: str, index: int, reach: float) -> None:
        pose = seen.geom_pos[index], seen.geom_quat[index]
        shown = int(seen.geom_group[index]) in self.groups and (kind == "geom" or self.sites)
        old, old_key = self._solids.get((kind, index), (None, None))
        key = surfaces.key_of(seen, index) if shown else ()
        if key == old_key:
            if old is not None and not (np.allclose(old.position, pose[0]) and np.allclose(old.wxyz, pose[1])):
                old.position, old.wxyz = pose
            return
        surface = surfaces.of_geom(seen, index, reach) if shown else None
        if surface is None:
            if old is not None:
                old.remove()
            self._solids[kind, index] = None, key
            return
        name = f"{self._frame(model, int(seen.geom_bodyid[index]))}/{node(model, kind, index)}"
        scene = self._server.scene  # a node of the same name is replaced
        if surface.glb is not None:
            handle = scene.add_glb(name, surface.glb, position=pose[0], wxyz=pose[1])
        else:
            rgb, alpha = (np.clip(surface.rgba[:3], 0, 1) * 255).round().astype(int), float(surface.rgba[3])
            handle = scene.add_mesh_simple(
                name,
                surface.shape.vertices,
                surface.shape.faces,
                color=tuple(rgb.tolist()),
                opacity=alpha if alpha < 1 else None,
                position=pose[0],
                wxyz=pose[1],
            )
        self._solids[kind, index] = handle, key

    def _set_lights(self, model: Any) -> None:
        names = ("active", "type", "pos", "dir", "ambient", "diffuse", "castshadow", "bodyid")
        head = model.vis.headlight
        key = (
            b"".join(getattr(model, f"light_{name}").tobytes() for name in names)
            + head.ambient.tobytes()
            + head.diffuse.tobytes()
        )
        if key == self._light_key:
            return
        self._light_key = key
        for light in self._lights:
            light.remove()
        self._lights = []
        scene, ambient, maps = self._server.scene, np.zeros(3), _MAX_SHADOW_MAPS
        if int(head.active):
            ambient += np.array(head.ambient)
            # The light at the camera becomes one from all sides that is brighter from above.
            bright = _light(np.array(head.diffuse))
            ground = tuple(component // 2 for component in bright["color"])
            self._lights.append(
                scene.add_light_hemisphere(
                    "/lights/head", sky_color=bright["color"], ground_color=ground, intensity=bright["intensity"]
                )
            )
        for light in np.flatnonzero(model.light_active).tolist():
            ambient += model.light_ambient[light]
            direction, directional = model.light_dir[light], int(model.light_type[light]) == _DIRECTIONAL
            shadow = bool(model.light_castshadow[light]) and maps > 0
            maps -= shadow * (3 if directional else 1)
            name, bright = f"/lights/{node(model, 'light', light)}", _light(model.light_diffuse[light])
            if directional:
                made = scene.add_light_directional(name, **bright, cast_shadow=shadow, position=tuple(-10 * direction))
            else:
                parent = self._frame(model, int(model.light_bodyid[light]))
                angle = min(np.radians(float(model.light_cutoff[light])), np.pi / 2)
                made = scene.add_light_spot(
                    f"{parent}{name}",
                    **bright,
                    cast_shadow=shadow,
                    direction=tuple(direction),
                    decay=0.0,
                    angle=angle,
                    penumbra=0.5,
                    position=model.light_pos[light],
                )
            self._lights.append(made)
        self._lights.append(scene.add_light_ambient("/lights/ambient", **_light(ambient)))


def _light(colour: np.ndarray) -> dict[str, Any]:
    """Colour and intensity of a light, as viser names them. The browser's unit is pi times MuJoCo's."""
    strength = float(colour.max())
    rgb = (255 * colour / strength).round().astype(int).tolist() if strength > 0 else [255] * 3
    return {"color": tuple(rgb), "intensity": np.pi * strength}
