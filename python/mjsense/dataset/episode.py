# SPDX-License-Identifier: Apache-2.0
"""One episode of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Literal

import numpy as np

from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.dataset import playback
from mjsense.dataset.episode_rows import EpisodeRows
from mjsense.dataset.quality import EpisodeQuality, idle_steps, kept_rows, quality_of

if TYPE_CHECKING:
    import mujoco


@checked
class Episode(EpisodeRows):
    """An episode of a recording: its attributes, whole arrays (``episode["obs/extra/tcp_pose"]``), videos, and replay."""

    @property
    def quality(self) -> EpisodeQuality:
        """Figures that describe how the episode was performed. They are computed at each access."""
        return quality_of(self)

    @property
    def idle(self) -> np.ndarray:
        """Whether neither joints nor commands moved in the step that led to an observation: bool ``[T]``."""
        return idle_steps(self)

    def trimmed(self) -> Episode:
        """This episode without idle steps: a view, whose rows, frames and length are those that are left. The recording stays
        complete.

        A step is left out if it is idle, no free object moves faster than 0.03 m/s in it, and nothing has moved by more than 0.01
        (rad or m) since the last observation that is left. The first observation and the idle steps at the end stay. A trimmed
        episode can set states, but not simulate its actions.
        """
        return self if self._kept is not None else Episode(self._entry, self.index, self._store, kept_rows(self))

    @property
    def states(self) -> np.ndarray:
        """float64 [T, nstate]: MuJoCo's state at every observation, in the order of ``mjSTATE_INTEGRATION``."""
        return playback.states_of(self)

    def model(self) -> mujoco.MjModel:
        """The model that was simulated: the archived one with this episode's sizes, masses, colours and so on. A new object."""
        return playback.model_of(self)

    def set_state(self, model: mujoco.MjModel, data: mujoco.MjData, t: int) -> None:
        """Sets ``data`` to the state at observation ``t`` and computes everything that depends on it. Does not step."""
        if not -self.length <= t < self.length:
            raise ValueError(f"t is {t}; episode {self.index} has {counted(self.length, 'observation')}")
        playback.set_state(model, data, self.states[t])

    def replay(
        self,
        from_: Literal["states", "actions"] = "states",
        *,
        model: mujoco.MjModel | None = None,
        data: mujoco.MjData | None = None,
    ) -> Iterator[tuple[int, mujoco.MjData]]:
        """Yields ``(t, data)`` for every observation, always the same ``data``.

        Args:
            from_: ``states`` sets every recorded state; ``actions`` sets the first one and then simulates with the recorded
                controls.
            model: Model to use; by default :meth:`model`.
            data: Data of ``model`` to use; by default new data.
        """
        return playback.replay_episode(self, from_, model, data)
