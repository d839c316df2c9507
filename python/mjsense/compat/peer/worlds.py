# SPDX-License-Identifier: Apache-2.0
"""The models and data of a simulation's worlds, and the world whose sensor is being computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mjsense import _core
from mjsense.compat.peer.by_world import ByWorld
from mjsense.core import mujoco_views
from mjsense.sim.simulation import Simulation

if TYPE_CHECKING:
    import mujoco


class PeerWorlds:
    """The worlds of a simulation; one of them is current."""

    def __init__(self, sim: Simulation, view: _core.TaskView | None) -> None:
        self.sim = sim
        """The simulation."""
        self._view = view
        self._world = 0
        self._datas: list[mujoco.MjData] = []
        self._copies: Any = None

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
