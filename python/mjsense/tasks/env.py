# SPDX-License-Identifier: Apache-2.0
"""Tasks as single gymnasium environments."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from mjsense.core.arguments import Seed, checked
from mjsense.scene.scene import Scene
from mjsense.scene.written_values import numbers
from mjsense.tasks.vector import TaskVectorEnv, _row


@checked
class TaskEnv(gymnasium.Env):
    """Plays episodes of a task in one world; created by :func:`make`. Equals a :class:`TaskVectorEnv` with one world, without the
    batch axis."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 15.15}

    def __init__(self, worlds: TaskVectorEnv) -> None:
        self.worlds = worlds
        """The underlying vector environment."""
        self.metadata = {key: value for key, value in worlds.metadata.items() if key != "autoreset_mode"}
        self.render_mode = worlds.render_mode
        self.observation_space = worlds.single_observation_space
        self.action_space = worlds.single_action_space
        self.action_groups = worlds.action_groups
        """Columns of an action by move group."""
        self._ended = ""
        self.sim = worlds.sim
        """The simulation, for reading only; the task writes its state."""

    def __reduce__(self) -> Any:
        """A copy, or what is pickled, is a new environment with the same arguments, in which no episode has begun."""
        return self.worlds._reduced(TaskEnv, self.spec)

    def reset(self, *, seed: Seed | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts the next episode; with a seed, the first episode of that seed; with ``options["episodes"] = [n]``, episode n."""
        super().reset(seed=seed)
        observation, infos = self.worlds.reset(seed=seed, options=options)
        self._ended = ""
        return _row(observation, 0), {"episode_info": _about(infos)}

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Performs one control step with the action ``[n]``: commands of the move groups; see :meth:`TaskVectorEnv.step`."""
        self._check_running("step")
        return self._single(*self.worlds.step(numbers("action", action)[None]))

    def step_chunk(self, actions: Any, stop_on_success: bool = False) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Performs several control steps ``[steps, n]`` with one observation after the last; see
        :meth:`TaskVectorEnv.step_chunk`."""
        self._check_running("step_chunk")
        return self._single(*self.worlds.step_chunk(numbers("actions", actions)[None], stop_on_success))

    def _check_running(self, call: str) -> None:
        if self._ended:
            raise gymnasium.error.ResetNeeded(f"{call}(): the episode has ended ({self._ended}): call reset() first")

    def _single(
        self,
        observation: dict[str, Any],
        reward: np.ndarray,
        terminated: np.ndarray,
        truncated: np.ndarray,
        infos: dict[str, Any],
    ) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        info: dict[str, Any] = {"success": bool(infos["success"][0]), "episode_info": _about(infos)}
        if "fault" in infos:
            info["fault"] = infos["fault"][0]
        self._ended = "terminated" if terminated[0] else "truncated" if truncated[0] else ""
        return _row(observation, 0), float(reward[0]), bool(terminated[0]), bool(truncated[0]), info

    def expert_action(self) -> np.ndarray:
        """Action of the policy given to ``make(..., policy="planner")`` for the current state, ``[n]``; sets ``expert_done``."""
        return self.worlds.expert_action()[0]

    @property
    def expert_done(self) -> bool:
        """Whether the policy reported ``done`` in the last :meth:`expert_action`."""
        return bool(self.worlds.expert_done[0])

    @property
    def scene(self) -> Scene:
        """The scene: ``env.scene["name"]`` is a sensor or an entity."""
        return self.sim.scene

    def render(self) -> Any:
        """Image of the first camera of the observation or, without one, of a default view."""
        pictures = self.worlds.render()
        return None if pictures is None else pictures[0]

    def close(self) -> None:
        """Frees the world."""
        self.worlds.close()


def _about(infos: dict[str, Any]) -> dict[str, Any]:
    """Which episode the world plays: seed, number, house, instruction and object."""
    values = {name: rows[0] for name, rows in infos["episode_info"].items() if not name.startswith("_")}
    return {name: value if name in ("instruction", "object", "seed") else int(value) for name, value in values.items()}
