# SPDX-License-Identifier: Apache-2.0
"""Policies that act in one world. Each world has a copy."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from mjsense.compat.molmospaces.env.sensors import PolicyNumRetriesSensor, PolicyPhaseSensor
from mjsense.tasks.policy import Policy
from mjsense.tasks.task import snake_case


class BasePolicy:
    """A policy of one world. Implement ``get_action(observation)``, and ``reset()`` if the policy has a state."""

    config: Any = None
    task: Any = None
    """The task that it is registered with. Otherwise, while the policy is called, that of the world:
    ``get_task_description()``, ``config`` and so on."""

    def __init__(self, config: Any = None, task: Any = None) -> None:
        self.config, self.task = config, task

    def reset(self) -> None:
        """Called at the start of an episode."""

    def get_action(self, observation: dict[str, Any]) -> dict[str, Any] | None:
        """Commands by move group, and ``done: True`` if the episode ends with them; None ends it without."""
        raise NotImplementedError(f"{type(self).__name__}: write get_action(observation)")

    def create_policy_sensors(self) -> list[Any]:
        """Sensors that are added to observations and recordings with this policy."""
        return []

    def _mjs_policy(self) -> Policy:
        return PolicyOfWorlds(self)


class PlannerPolicy(BasePolicy):
    """A policy with phases. Implement ``get_all_phases()``, ``get_phase()`` and ``retry_count`` as well."""

    retry_count: int = 0

    def get_all_phases(self) -> dict[str, int]:
        """Numbers of the phases."""
        raise NotImplementedError(f"{type(self).__name__}: write get_all_phases()")

    def get_phase(self) -> str:
        """Name of the current phase."""
        raise NotImplementedError(f"{type(self).__name__}: write get_phase()")

    def create_policy_sensors(self) -> list[Any]:
        return [PolicyPhaseSensor(uuid="policy_phase"), PolicyNumRetriesSensor(uuid="policy_num_retries")]


class InferencePolicy(BasePolicy):
    """A policy with a model. Implement ``prepare_model``, ``obs_to_model_input``, ``inference_model`` and
    ``model_output_to_action``."""

    def get_action(self, observation: dict[str, Any]) -> dict[str, Any] | None:
        return self.model_output_to_action(self.inference_model(self.obs_to_model_input(observation)))

    def prepare_model(self, *args: Any) -> None:
        """Loads the model."""
        raise NotImplementedError(f"{type(self).__name__}: write prepare_model()")

    def obs_to_model_input(self, obs: dict[str, Any]) -> Any:
        """What the model receives."""
        raise NotImplementedError(f"{type(self).__name__}: write obs_to_model_input(obs)")

    def inference_model(self, model_input: Any) -> Any:
        """What the model returns."""
        raise NotImplementedError(f"{type(self).__name__}: write inference_model(model_input)")

    def model_output_to_action(self, model_output: Any) -> dict[str, Any]:
        """Commands by move group."""
        raise NotImplementedError(f"{type(self).__name__}: write model_output_to_action(model_output)")


class StatefulPolicy(BasePolicy):
    """A policy that all worlds share: its state of an episode is exchanged before a world's call."""

    def get_state(self) -> Any:
        """The state of an episode."""
        raise NotImplementedError(f"{type(self).__name__}: write get_state()")

    def set_state(self, state: Any) -> None:
        """Continues the episode of this state."""
        raise NotImplementedError(f"{type(self).__name__}: write set_state(state)")


class _TaskOfWorld:
    """The task, while the policy of one world is called. Other attributes are those that sensors see."""

    def __init__(self, policy: Policy, world: int) -> None:
        self._policy, self._world = policy, world

    def get_task_description(self) -> str:
        """The instruction of the episode."""
        return self._policy.instructions[self._world]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"the task has no '{name}'")
        env = self._policy.sim.env
        env.current_batch_index = self._world
        return getattr(env.task, name)


class PolicyOfWorlds(Policy):
    """Runs a copy of a :class:`BasePolicy`, or of a policy of molmo_spaces, in every world. One with ``get_state`` and
    ``set_state`` is not copied: all worlds share it."""

    def __init__(self, first: Any) -> None:
        self.name = snake_case(type(first).__name__)
        self.first = first
        self.phases = dict(first.get_all_phases()) if isinstance(first, PlannerPolicy) else {}
        self.instances: list[Any] = [first]
        self._is_shared = all(callable(getattr(first, name, None)) for name in ("get_state", "set_state"))

    def sensors(self) -> list[Any]:
        """The policy's sensors. Sensors of phases are mjsense's own."""
        sensors = self.first.create_policy_sensors()
        return [s for s in sensors if not (self.phases and isinstance(s, (PolicyPhaseSensor, PolicyNumRetriesSensor)))]

    def initialize(self) -> None:
        own = getattr(self.first, "task", None)
        self._tasks = [_TaskOfWorld(self, world) if own is None else own for world in range(self.num_worlds)]
        self._states: list[Any] = [None] * self.num_worlds
        self.instances = [self.first] * self.num_worlds
        if not self._is_shared:
            self.instances[1:] = [copy.deepcopy(self.first, {id(own): own}) for _ in range(1, self.num_worlds)]
        task = self.sim.env.task
        if task is not None:
            task._policies = self.instances

    def reset(self, ids: np.ndarray) -> None:
        for world in ids.tolist():
            policy = self.instances[world]
            policy.task = self._tasks[world]
            policy.reset()
            if self._is_shared:
                self._states[world] = policy.get_state()
            self._note_phase(world)

    def act(self, obs: dict[str, Any]) -> dict[str, np.ndarray]:
        done = np.zeros(self.num_worlds, bool)
        groups: dict[str, np.ndarray] = {}
        for world in np.flatnonzero(self.wanted).tolist():
            action = self._action(world, _row(obs, world))
            self._note_phase(world)
            if action is None:
                done[world] = True
                continue
            for name, values in action.items():
                if name in ("done", "success"):
                    done[world] |= name == "done" and bool(values)
                    continue
                values = np.atleast_1d(np.asarray(values, np.float64))
                if values.size:
                    groups.setdefault(name, np.full((self.num_worlds, values.size), np.nan))[world] = values
        self._hold(groups)
        return {**groups, "done": done}

    def _action(self, world: int, observation: dict[str, Any]) -> dict[str, Any] | None:
        policy = self.instances[world]
        policy.task = self._tasks[world]
        if not self._is_shared:
            return policy.get_action(observation)
        policy.set_state(self._states[world])
        action = policy.get_action(observation)
        self._states[world] = policy.get_state()
        return action

    def _note_phase(self, world: int) -> None:
        policy = self.instances[world]
        if isinstance(policy, PlannerPolicy):
            self.phase[world], self.num_retries[world] = self.phases[policy.get_phase()], policy.retry_count

    def _hold(self, groups: dict[str, np.ndarray]) -> None:
        """Worlds without a command for a group that other worlds command keep the targets of its controller."""
        for name, rows in groups.items():
            for world in np.flatnonzero(np.isnan(rows).any(1)):
                targets = self.sim.env.task._view.targets(int(world)).get(name) if self.sim.env.task is not None else None
                rows[world] = 0 if targets is None or len(targets) != rows.shape[1] else targets


def _row(obs: dict[str, Any], world: int) -> dict[str, Any]:
    return {key: _row(value, world) if isinstance(value, dict) else np.array(value[world]) for key, value in obs.items()}
