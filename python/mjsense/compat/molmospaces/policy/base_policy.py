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

    task: Any = None
    """The task that it is registered with."""

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


class PolicyOfWorlds(Policy):
    """Runs a copy of a :class:`BasePolicy` in every world."""

    def __init__(self, first: BasePolicy) -> None:
        self.name = snake_case(type(first).__name__)
        self.first = first
        self.phases = dict(first.get_all_phases()) if isinstance(first, PlannerPolicy) else {}
        self.instances: list[BasePolicy] = [first]

    def sensors(self) -> list[Any]:
        """The policy's sensors. Sensors of phases are mjsense's own."""
        sensors = self.first.create_policy_sensors()
        return [s for s in sensors if not (self.phases and isinstance(s, (PolicyPhaseSensor, PolicyNumRetriesSensor)))]

    def initialize(self) -> None:
        memo = {id(self.first.task): self.first.task}
        self.instances = [self.first] + [copy.deepcopy(self.first, dict(memo)) for _ in range(1, self.num_worlds)]
        task = self.sim.env.task
        if task is not None:
            task._policies = self.instances

    def reset(self, ids: np.ndarray) -> None:
        for world in ids:
            self.instances[world].reset()
            self._note_phase(int(world))

    def act(self, obs: dict[str, Any]) -> dict[str, np.ndarray]:
        done = np.zeros(self.num_worlds, bool)
        groups: dict[str, np.ndarray] = {}
        for world in np.flatnonzero(self.wanted):
            action = self.instances[world].get_action(_row(obs, int(world)))
            self._note_phase(int(world))
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
