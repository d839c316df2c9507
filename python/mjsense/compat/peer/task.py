# SPDX-License-Identifier: Apache-2.0
"""The task as sensors written for MolmoSpaces see it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.compat.peer import policy
from mjsense.compat.peer.by_world import ByWorld
from mjsense.compat.peer.config import PeerConfig
from mjsense.compat.peer.policy import PeerPolicy
from mjsense.compat.peer.robot import RobotWorlds


class PeerTask:
    """The task. Where MolmoSpaces has one world, the value is that of the world whose sensor is being computed.

    All other attributes are those of the user-defined :class:`mjsense.Task`, if the task is one. Such a task is evaluated after
    the sensors, so ``get_info()`` and ``judge_success()`` then refer to the previous observation.
    """

    def __init__(self, env: RobotWorlds, view: _core.TaskView) -> None:
        self.env = self._env = env
        self._view: Any = view
        self.config = PeerConfig(self)
        """The part of the experiment's configuration that sensors read."""
        self._policy: PeerPolicy | None = None
        self._policies: Sequence[Any] = ()
        """The instances of a policy that has one for each world."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or self._view.own is None:
            raise AttributeError(f"the task has no '{name}'")
        return getattr(self._view.own, name)

    @property
    def _world(self) -> int:
        return self._env.current_batch_index

    @property
    def last_action(self) -> dict[str, Any] | None:
        """The action as the policy returned it, by move group; None before the first.

        It contains ``success`` if the policy judged it.
        """
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
        """The task's information about the state, by world: errors, success, step."""
        return ByWorld(self._env.n_batch, lambda world: json.loads(self._view.info(world)))

    def get_task_objects(self, batch_index: int = 0) -> dict[str, str]:
        """Bodies by role: the grippers, then the objects of the task."""
        view, model = self._env.robots[batch_index].robot_view, self._env.mj_model
        objects = {name: model.body(view.get_move_group(name).root_body_id).name for name in view.get_gripper_movegroup_ids()}
        return objects | dict(self._view.objects(batch_index))

    def get_task_description(self) -> str:
        """The instruction, for example "Pick up the mug"."""
        return self._view.description(self._world)

    @property
    def episode_step_count(self) -> int:
        """Control steps of the episode."""
        return self._view.step(self._world)

    def num_steps_taken(self) -> int:
        """Same as :attr:`episode_step_count`."""
        return self.episode_step_count

    def judge_success(self) -> bool:
        """Whether the task succeeds in the current state."""
        return self._view.evaluate(self._world)[1]

    def get_reward(self) -> np.ndarray:
        """Reward of the current state, ``[1]``."""
        return np.array([self._view.evaluate(self._world)[0]])

    def is_terminal(self) -> bool:
        """Whether the policy or success ended the episode; a time-out does not count."""
        return self._view.evaluate(self._world)[2]

    def is_timed_out(self) -> bool:
        """Whether the horizon has been reached."""
        return self._view.evaluate(self._world)[3]

    def is_done(self) -> bool:
        """Whether the episode is terminal or timed out."""
        return self.is_terminal() or self.is_timed_out()
