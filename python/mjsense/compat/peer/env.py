# SPDX-License-Identifier: Apache-2.0
"""The worlds of a simulation."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.compat.peer.cameras import Cameras
from mjsense.compat.peer.robot import RobotWorlds
from mjsense.compat.peer.task import PeerTask
from mjsense.core import mujoco_names
from mjsense.sim.simulation import Simulation


class PeerEnv(RobotWorlds):
    """The worlds of a simulation. All other attributes are the simulation's: ``env.qpos[batch_index]``, ``env.scene["imu"]``."""

    def __init__(self, sim: Simulation, view: _core.TaskView | None = None) -> None:
        super().__init__(sim, view)
        self._task: PeerTask | None = None
        self.camera_manager = SimpleNamespace(registry=Cameras(self))
        """``camera_manager.registry[name]``: cameras by the names of the sensors that render them."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("sim", "_view"):
            raise AttributeError(name)
        if name in ("robots", "current_robot"):
            raise AttributeError(f"env.{name}: this simulation knows no robot; those of recordings and make_vec do")
        return getattr(self.sim, name)

    @property
    def task(self) -> PeerTask | None:
        """The task, or None in a plain simulation."""
        if self._task is None and self._view is not None:
            self._task = PeerTask(self, self._view)
        return self._task

    @contextmanager
    def _computing_sensors(self) -> Iterator[PeerEnv]:
        """Context in which sensors are computed: MjModel and MjData objects that they keep are current.

        It may be nested, because a sensor may read another.
        """
        self._make_current()
        before = self._world
        try:
            yield self
        finally:
            self._world = before

    def _image(self, camera_name: str, field: str) -> np.ndarray:
        sensors = self.sim.scene.sensors
        if camera_name not in self.camera_manager.registry:
            raise KeyError(f"Camera '{camera_name}' not found in registry.")
        fields = sensors[camera_name].fields
        if field not in fields:
            raise KeyError(f"camera '{camera_name}' has no {field}, only {', '.join(fields)}")
        return fields[field][self._world].copy()

    def render_rgb_frame(self, camera_name: str) -> np.ndarray:
        """uint8 ``[H, W, 3]``, row 0 is the top."""
        return self._image(camera_name, "rgb")

    def render_depth_frame(self, camera_name: str) -> np.ndarray:
        """float32 ``[H, W]``, m along the optical axis, of a camera that records depth."""
        depth = self._image(camera_name, "depth")
        return depth.reshape(depth.shape[:2])

    def render_segmentation_frame(self, camera_name: str) -> np.ndarray:
        """int32 ``[H, W, 2]``: id and type of the object, -1 the background."""
        return self._image(camera_name, "segmentation")

    def get_segmentation_mask_of_object(self, object_name: str, camera_name: str, batch_index: int = 0) -> np.ndarray | None:
        """bool ``[H, W]``: where the visible geoms of the body and those below it are; None if there is no such body."""
        model = self.mj_model
        root = mujoco_names.name2id(model, mujoco_names.Obj.BODY, object_name)
        if root < 0:
            return None
        before, self.current_batch_index = self._world, batch_index
        try:
            picture = self.render_segmentation_frame(camera_name)
        finally:
            self._world = before
        geoms = np.flatnonzero(mujoco_names.bodies_below(model, root)[model.geom_bodyid] & (model.geom_group < 3))
        return (picture[..., 1] == mujoco_names.Obj.GEOM) & np.isin(picture[..., 0], geoms)
