# SPDX-License-Identifier: Apache-2.0
"""The worlds of a simulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.compat.peer.by_world import ByWorld
from mjsense.compat.peer.cameras import Cameras
from mjsense.compat.peer.robot import PeerRobot
from mjsense.compat.peer.task import PeerTask
from mjsense.core import mujoco_names, mujoco_views

if TYPE_CHECKING:
    import mujoco

    from mjsense.sim.simulation import Simulation


class PeerEnv:
    """The worlds of a simulation. All other attributes are the simulation's: ``env.qpos[batch_index]``, ``env.scene["imu"]``."""

    def __init__(self, sim: Simulation, view: _core.TaskView | None = None) -> None:
        self.sim = sim
        """The simulation."""
        self._view = view
        self._task: PeerTask | None = None
        self._world = 0
        self._datas: list[mujoco.MjData] = []
        self._copies: Any = None
        self.camera_manager = SimpleNamespace(registry=Cameras(self))
        """``camera_manager.registry[name]``: cameras by the names of the sensors that render them."""
        self._robots: tuple[PeerRobot, ...] = ()

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

    @property
    def n_batch(self) -> int:
        """Number of worlds."""
        return self.sim.num_worlds

    @property
    def current_batch_index(self) -> int:
        """Index of the world whose sensor is being computed."""
        return self._world

    @current_batch_index.setter
    def current_batch_index(self, world: int) -> None:
        if not 0 <= world < self.n_batch:
            raise ValueError(f"Batch index {world} out of range [0, {self.n_batch - 1}]")
        self._world = world

    @property
    def mj_models(self) -> Sequence[mujoco.MjModel]:
        """A mujoco.MjModel of each world with the world's own values: :meth:`mjsense.Simulation.model_of`."""
        return ByWorld(self.n_batch, self.sim.model_of)

    @property
    def mj_model(self) -> mujoco.MjModel:
        """The model of the world whose sensor is being computed."""
        return self.sim.model_of(self._world)

    current_model = mj_model

    @property
    def mj_datas(self) -> Sequence[mujoco.MjData]:
        """A mujoco.MjData of each world as it is now, derived quantities and contacts included.

        These are copies: writing to them does not change the worlds.
        """
        if self._copies is None:
            self._datas = [mujoco_views.data_of(model) for model in self.mj_models]
            self._copies = self.sim._core.data_copies(self._datas)
        self._make_current()
        return self._datas

    @property
    def current_data(self) -> mujoco.MjData:
        """The data of the world whose sensor is being computed."""
        return self.mj_datas[self._world]

    def _make_current(self) -> None:
        self.sim._models.follow()
        if self._copies is not None:
            self.sim._core.refresh(self._copies)

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

    @property
    def robots(self) -> Sequence[PeerRobot]:
        """The robot of each world."""
        if self._view is None:
            raise AttributeError("robots")
        if not self._robots:
            self._robots = tuple(PeerRobot(self, self._view, world) for world in range(self.n_batch))
        return self._robots

    @property
    def current_robot(self) -> PeerRobot:
        """The robot of the world whose sensor is being computed."""
        return self.robots[self._world]

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
