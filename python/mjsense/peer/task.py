# SPDX-License-Identifier: Apache-2.0
"""What is played."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.peer import policy
from mjsense.peer.config import PeerConfig
from mjsense.peer.policy import PeerPolicy

if TYPE_CHECKING:
    from mjsense.peer.env import PeerEnv


class _Infos(Sequence):
    """What the task says of each world, read when it is asked for."""

    def __init__(self, view: _core.TaskView, worlds: int) -> None:
        self._view: Any = view
        self._worlds = worlds

    def __len__(self) -> int:
        return self._worlds

    def __getitem__(self, world: Any) -> Any:
        if isinstance(world, slice):
            return [self[w] for w in range(*world.indices(self._worlds))]
        if not -self._worlds <= world < self._worlds:
            raise IndexError(world)
        return json.loads(self._view.info(int(world) % self._worlds))


class PeerTask:
    """What is played. What MolmoSpaces knows of its one world is here that of the world whose sensor is asked.

    Of a :class:`mjsense.Task` of yours everything else is there, too; as it judges after the sensors, ``get_info()`` and
    ``judge_success()`` are then of the observation before.
    """

    def __init__(self, env: PeerEnv, view: _core.TaskView) -> None:
        self.env = self._env = env
        self._view: Any = view
        self.config = PeerConfig(self)
        """Of the experiment, as far as sensors read it."""
        self._policy: PeerPolicy | None = None
        self._policies: Sequence[Any] = ()
        """Of a policy with an instance for each world: these."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or self._view.own is None:
            raise AttributeError(f"the task has no '{name}'")
        return getattr(self._view.own, name)

    @property
    def _world(self) -> int:
        return self._env.current_batch_index

    @property
    def last_action(self) -> dict[str, Any] | None:
        """As the policy gave it, by move group, and ``success`` if it judged; None before the first."""
        return self._view.last_action(self._world)

    @property
    def _registered_policy(self) -> Any:
        if self._policies:
            return self._policies[self._world]
        if not self._view.has_policy or self._view.plan(0) is None:
            return None
        policy.register()
        self._policy = self._policy or PeerPolicy(self._env, self._view)
        return self._policy

    def get_info(self) -> Sequence[dict[str, Any]]:
        """What the task says about the state, by world: errors, success, step."""
        return _Infos(self._view, self._env.n_batch)

    def get_task_objects(self, batch_index: int = 0) -> dict[str, str]:
        """Bodies by role: the grippers, then what the task is about."""
        view, model = self._env.robots[batch_index].robot_view, self._env.mj_model
        objects = {name: model.body(view.get_move_group(name).root_body_id).name for name in view.get_gripper_movegroup_ids()}
        return objects | dict(self._view.objects(batch_index))

    def get_task_description(self) -> str:
        """Pick up the mug"""
        return self._view.description(self._world)

    @property
    def episode_step_count(self) -> int:
        """Control steps of the episode."""
        return self._view.step(self._world)

    def num_steps_taken(self) -> int:
        """The same."""
        return self.episode_step_count

    def judge_success(self) -> bool:
        """At this moment."""
        return self._view.evaluate(self._world)[1]

    def get_reward(self) -> np.ndarray:
        """``[1]``."""
        return np.array([self._view.evaluate(self._world)[0]])

    def is_terminal(self) -> bool:
        """The episode is over by the policy's word or by success; a time-out is not."""
        return self._view.evaluate(self._world)[2]

    def is_timed_out(self) -> bool:
        """The horizon is reached."""
        return self._view.evaluate(self._world)[3]

    def is_done(self) -> bool:
        """One of the two."""
        return self.is_terminal() or self.is_timed_out()
