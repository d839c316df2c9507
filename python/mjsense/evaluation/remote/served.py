# SPDX-License-Identifier: Apache-2.0
"""A policy that answers the observations of clients instead of those of a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.evaluation.policies import policy_from
from mjsense.evaluation.protocol import BatchedPolicy, as_numbers
from mjsense.evaluation.remote.adapter import EPISODE, PROMPT, SEED
from mjsense.tasks.policy import FunctionPolicy, Policy
from mjsense.tasks.vector import make_vec

Layout = list[tuple[str, list[float], list[float]]]
"""Name of each move group, and the limits of its commands."""


class BadRequest(ValueError):
    """The client's message is wrong, not the policy."""


class ServedPolicy:
    """One policy for all connections, which are its worlds. It is called for one connection at a time, so that an answer depends neither on
    the other clients nor on the time of their messages.

    Args:
        policy: See :func:`mjsense.evaluation.policy_from`.
        options: Arguments of the policy.
        layout: Move groups of the robot; a :class:`mjsense.Policy` needs them.
        connections: Maximum number of connections.
    """

    def __init__(self, policy: Any, options: Mapping[str, Any], layout: Layout | None, connections: int) -> None:
        made = policy_from(policy, **options)
        if isinstance(made, str):
            raise ValueError(
                f"policy '{made}' is computed together with its episode: only policies that need observations alone can be served"
            )
        self.policy, self.layout = made, layout
        self._alone = isinstance(made, (BatchedPolicy, FunctionPolicy))
        """Whether the policy receives the rows of one connection, and not of all worlds."""
        if not self._alone:
            if layout is None:
                raise ValueError(
                    f"policy '{made._mjs_name()}' is a mjsense.Policy, which knows the robot: name a task, and the robot if it is not the task's (--task, --robot)"
                )
            simulation: Any = _NoSimulation(made._mjs_name(), connections)
            made._mjs_bind(simulation, _streams_of(made), layout)

    @property
    def observation(self) -> list[str] | None:
        """Sensors or streams that the policy receives; None: all."""
        return None if self.policy.observation is None else list(self.policy.observation)

    def begin(self, world: int, message: Mapping[str, Any], default_episode: int) -> None:
        """An episode begins on this connection, with its first message."""
        seed, episode = _integer(message, SEED, 0), _integer(message, EPISODE, default_episode)
        if self._alone:
            self.policy.reset(np.array([world]))
        else:
            self.policy._mjs_reset([world], [episode], seed, [_prompt(message)])

    def answer(self, world: int, message: Mapping[str, Any]) -> np.ndarray:
        """Actions ``[H, n]`` for an observation.

        Raises:
            BadRequest: The message is wrong.
        """
        prompt = _prompt(message)
        observation = _rows({key: value for key, value in message.items() if key not in (PROMPT, SEED, EPISODE)})
        if self.observation is not None:
            observation = _chosen(observation, self.observation)
        policy = self.policy
        if isinstance(policy, BatchedPolicy):
            given = policy.model.act({**observation, "world_ids": np.array([world]), "instructions": [prompt]})
        elif self._alone:
            given = policy.act(observation)
        else:
            policy.instructions[world] = prompt
            policy.wanted[:] = False
            policy.wanted[world] = True
            given = policy.act(_repeated(observation, policy.num_worlds))
        return self._actions(given, 0 if self._alone else world)

    def _actions(self, given: Any, row: int) -> np.ndarray:
        name = self.policy._mjs_name()
        if isinstance(given, Mapping):
            given = self._joined(dict(given))
        actions = as_numbers(given)
        if actions.ndim not in (2, 3) or len(actions) <= row or 0 in actions.shape:
            raise ValueError(
                f"policy '{name}': act() returned actions of shape {actions.shape}; expected (rows, n) or (rows, H, n)"
            )
        return actions[row].reshape(-1, actions.shape[-1])

    def _joined(self, given: dict[str, Any]) -> Any:
        """Actions of all move groups, of those of each."""
        name = self.policy._mjs_name()
        for flag in ("done", "hold"):
            if np.any(given.pop(flag, False)):
                raise ValueError(f"policy '{name}': act() returned '{flag}', and openpi's protocol has actions only")
        given.pop("success", None)
        if given.keys() == {"action"}:
            return given["action"]
        groups = [group for group, low, _ in self.layout or () if low]
        if given.keys() != set(groups):
            raise ValueError(
                f"policy '{name}': act() returned commands for {', '.join(given) or 'no group'}; expected {', '.join(groups) or 'an array'}"
            )
        return np.concatenate([as_numbers(given[group]) for group in groups], -1)


def layout_of(task: str, robot: str | None, arm_controller: str) -> Layout:
    """Move groups of the robot of a task."""
    env = make_vec(task, robot, num_envs=1, cameras=[], arm_controller=arm_controller)
    try:
        return env._rollout.action_layout()
    finally:
        env.close()


class _NoSimulation:
    """In the place of the simulation, which a served policy does not have."""

    def __init__(self, policy: str, num_worlds: int) -> None:
        self.num_worlds = num_worlds
        self._policy = policy

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"policy '{self._policy}' reads sim.{name}, and a served policy has observations only")


def _streams_of(policy: Policy) -> list[Any]:
    """Stand-ins of the streams that a policy observes, which :meth:`mjsense.Policy._mjs_bind` looks up."""
    return [(name, SimpleNamespace(name=name, shape=(1,), is_dict=False), np.zeros(1)) for name in policy.observation or ()]


def _prompt(message: Mapping[str, Any]) -> str:
    prompt = message.get(PROMPT, "")
    if not isinstance(prompt, str):
        raise BadRequest(f"'{PROMPT}' is a {type(prompt).__name__}: must be a text")
    return prompt


def _integer(message: Mapping[str, Any], key: str, default: int) -> int:
    value = message.get(key, default)
    if type(value) is not int or not 0 <= value < 2**63:
        raise BadRequest(f"'{key}' is {value!r:.80}: must be a number from 0 on")
    return value


def _rows(message: Mapping[str, Any]) -> dict[str, Any]:
    """Rows ``[1, ...]`` nested by the parts of their names."""
    nested: dict[str, Any] = {}
    for key, value in message.items():
        *parents, last = key.split("/")
        inner = nested
        for part in parents:
            inner = inner.setdefault(part, {})
            if not isinstance(inner, dict):
                raise BadRequest(f"the observation has '{part}' and '{key}'")
        if last in inner:
            raise BadRequest(f"the observation has '{key}' twice")
        inner[last] = _rows(value) if isinstance(value, dict) else _row(key, value)
    return nested


def _row(key: str, value: Any) -> np.ndarray:
    try:
        row = np.array(value)  # a copy that can be written to
    except ValueError:
        raise BadRequest(f"'{key}' has lists of different lengths") from None
    if row.dtype.kind not in "biuf":
        raise BadRequest(f"'{key}' is a {type(value).__name__}: must be an array of numbers")
    return row[None]


def _chosen(observation: dict[str, Any], names: list[str]) -> dict[str, Any]:
    """The sensors or streams of these names."""
    chosen: dict[str, Any] = {}
    for name in names:
        *parents, last = name.split("/")
        source: Any = observation
        target = chosen
        for part in parents:
            source = source.get(part) if isinstance(source, dict) else None
            target = target.setdefault(part, {})
        if not isinstance(source, dict) or last not in source:
            raise BadRequest(
                f"the observation has no '{name}', which the policy needs{did_you_mean(name, observation, 'it has')}"
            )
        target[last] = source[last]
    return chosen


def _repeated(observation: Mapping[str, Any], count: int) -> dict[str, Any]:
    """The same row for all worlds."""
    return {
        name: _repeated(value, count) if isinstance(value, Mapping) else np.broadcast_to(value, (count, *value.shape[1:]))
        for name, value in observation.items()
    }
