# SPDX-License-Identifier: Apache-2.0
"""Cameras by the name of the sensor that renders them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mjsense.compat.peer.matrices import matrix_of
from mjsense.compat.peer.worlds import PeerWorlds


class Cameras:
    """Cameras by the name of the sensor that renders them."""

    def __init__(self, env: PeerWorlds) -> None:
        self._env = env

    def _names(self) -> dict[str, str]:
        """MuJoCo's name of each."""
        if self._env._view is not None:
            return {camera["name"]: camera["mjcf_camera"] for camera in self._env._view.cameras()}
        sensors = self._env.sim.scene.sensors
        return {name: s.cfg.camera_name or name for name, s in sensors.items() if s.kind == "camera" and s.cfg is not None}

    def __contains__(self, name: object) -> bool:
        return name in self._names()

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def __getitem__(self, name: str) -> PeerCamera:
        names = self._names()
        if name not in names:
            raise KeyError(f"Camera '{name}' not found in registry: there are {', '.join(names) or 'none'}")
        return PeerCamera(self._env, name, self._env.mj_model.camera(names[name]).id)

    def keys(self) -> list[str]:
        return list(self)


class PeerCamera:
    """A camera in the world whose sensor is being computed, in its current pose."""

    def __init__(self, env: PeerWorlds, name: str, camera: int) -> None:
        self._env, self.name, self._id = env, name, camera

    @property
    def _axes(self) -> np.ndarray:
        return self._env.current_data.cam_xmat[self._id].reshape(3, 3)

    @property
    def pos(self) -> np.ndarray:
        """m, world ``[3]``."""
        return self._env.current_data.cam_xpos[self._id].copy()

    @property
    def forward(self) -> np.ndarray:
        """Unit vector, world ``[3]``."""
        return -self._axes[:, 2]

    @property
    def up(self) -> np.ndarray:
        """Unit vector, world ``[3]``."""
        return self._axes[:, 1].copy()

    @property
    def fov(self) -> float:
        """Vertical, degrees."""
        return float(self._env.mj_model.cam_fovy[self._id])

    def get_pose(self) -> np.ndarray:
        """4x4, columns right, down, forward, position: camera to world."""
        axes = self._axes
        return matrix_of(self.pos, np.stack([axes[:, 0], -axes[:, 1], -axes[:, 2]], axis=1))
