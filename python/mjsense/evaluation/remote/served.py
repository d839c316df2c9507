# SPDX-License-Identifier: Apache-2.0
"""A policy that answers the observations of clients instead of those of a simulation."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.evaluation.policies import policy_from
from mjsense.evaluation.protocol import BatchedPolicy, as_numbers
from mjsense.evaluation.remote.adapter import ACTIONS, EPISODE, PROMPT, SEED
from mjsense.evaluation.remote.adapters import adapter_of
from mjsense.evaluation.remote.served_adapter import ServedAdapter
from mjsense.sensors.nested_streams import Streams, choose_streams, nest
from mjsense.tasks.making import make_vec
from mjsense.tasks.policy import FunctionPolicy
from mjsense.tasks.task import group_slices
from mjsense.tasks.vector import TaskVectorEnv


class BadRequest(ValueError):
    """The client's message is wrong, not the policy."""


class ServedPolicy:
    """One policy for all connections, which are its worlds. It is called for one connection at a time, so that an answer depends
    neither on the other clients nor on the time of their messages.

    Args:
        policy: See :func:`mjsense.evaluation.policy_from`.
        options: Arguments of the policy.
        task: Task and further arguments of :func:`mjsense.make_vec`, whose streams and move groups a :class:`mjsense.Policy`
            needs; empty: none.
        connections: Maximum number of connections.
        adapter: Names and conventions of the messages, see :class:`mjsense.evaluation.RemotePolicy`; empty:
            streams and actions as they are.
    """

    def __init__(
        self, policy: Any, options: Mapping[str, Any], task: Mapping[str, Any], connections: int, adapter: str = ""
    ) -> None:
        made = policy_from(policy, **options)
        if isinstance(made, str):
            raise ValueError(
                f"policy '{made}' is computed together with its episode: only policies that need observations alone can be served"
            )
        self.policy, self._name = made, made._mjs_name()
        self._alone = isinstance(made, (BatchedPolicy, FunctionPolicy))
        """Whether the policy receives the rows of one connection, and not of all worlds."""
        self.observation: list[str] | None = None if made.observation is None else list(made.observation)
        """Sensors or streams that the policy receives; None: all of a message."""
        self._adapter: ServedAdapter | None = None
        self._env: TaskVectorEnv | None = None
        if self._alone and not adapter:
            return
        if not task:
            what = "is a mjsense.Policy, which knows the robot" if not self._alone else f"has the adapter '{adapter}'"
            raise ValueError(
                f"policy '{self._name}' {what}: name a task, and the robot if it is not the task's (--task, --robot)"
            )
        self._env = make_vec(**task, num_envs=1)
        streams = [(sensor, spec, _rows_of(spec, connections)) for sensor, spec, _ in self._env._rollout.streams()]
        by_name = {spec.name: (sensor, spec, rows) for sensor, spec, rows in streams}
        layout = self._env._rollout.action_layout()
        self._groups = [group for group, low, _ in layout if low]
        if not self._alone:
            simulation: Any = _NoSimulation(self._name, connections)
            self._observed, _ = made._mjs_bind(simulation, streams, layout)
            self._rows: dict[str, np.ndarray] = {spec.name: rows for _, spec, rows in streams}
        if not self._alone or made.observation is not None:
            self.observation = choose_streams(made.observation, by_name)
        if adapter:
            self._adapt(adapter, by_name, layout)

    def _adapt(self, name: str, by_name: Streams, layout: list[Any]) -> None:
        groups, specs = group_slices(layout), {stream: spec for stream, (_, spec, _) in by_name.items()}
        made = adapter_of(name, by_name, groups, self.observation)
        low, high = (np.concatenate([[], *(row[k] for row in layout)]) for k in (1, 2))
        made.check(specs, groups, low, high)
        self._adapter = ServedAdapter(made, specs, groups, self.observation)
        self.observation = self._adapter.streams

    def reply(self, actions: np.ndarray) -> dict[str, np.ndarray]:
        """The answer that has these actions ``[H, n]``."""
        return {ACTIONS: actions} if self._adapter is None else self._adapter.answer(actions)

    def close(self) -> None:
        if self._env is not None:
            self._env.close()

    def begin(self, world: int, message: Mapping[str, Any], default_episode: int) -> None:
        """An episode begins on this connection, with its first message."""
        seed, episode = _integer(message, SEED, 0), _integer(message, EPISODE, default_episode)
        if self._alone:
            self.policy.reset(np.array([world]))
        else:
            self.policy._mjs_reset([world], [episode], seed, [self._prompt(message)])

    def answer(self, world: int, message: Mapping[str, Any]) -> np.ndarray:
        """Actions ``[H, n]`` for an observation.

        Raises:
            BadRequest: The message is wrong.
        """
        prompt, policy = self._prompt(message), self.policy
        numbers = self._numbers(message)
        if not self._alone:
            self._write(world, numbers)
            policy.instructions[world] = prompt
            policy.wanted[:] = False
            policy.wanted[world] = True
            return self._actions(policy.act(self._observed), world)
        observation = _nested(numbers, self.observation)
        if isinstance(policy, BatchedPolicy):
            return self._actions(policy.model.act({**observation, "world_ids": np.array([world]), "instructions": [prompt]}), 0)
        return self._actions(policy.act(observation), 0)

    def _prompt(self, message: Mapping[str, Any]) -> str:
        key = PROMPT if self._adapter is None else self._adapter.prompt
        return _text(key, message.get(key, "")) if key else ""

    def _numbers(self, message: Mapping[str, Any]) -> dict[str, np.ndarray]:
        if self._adapter is None:
            return _numbers({key: value for key, value in message.items() if key not in (PROMPT, SEED, EPISODE)})
        try:
            return self._adapter.rows(message)
        except ValueError as error:
            raise BadRequest(str(error)) from None

    def _write(self, world: int, numbers: Mapping[str, np.ndarray]) -> None:
        """Writes an observation into the rows that the policy sees."""
        for name in self.observation or ():
            if name not in numbers:
                raise _missing(name, numbers)
            row, given = self._rows[name][world], numbers[name]
            if given.shape != row.shape or not np.can_cast(given.dtype, row.dtype, "same_kind"):
                raise BadRequest(f"'{name}' is {given.dtype} {given.shape}: must be {row.dtype} {row.shape}")
            with np.errstate(over="ignore"):
                row[...] = given

    def _actions(self, given: Any, row: int) -> np.ndarray:
        if isinstance(given, Mapping):
            given = self._joined(dict(given), row)
        actions = as_numbers(given)
        if actions.ndim not in (2, 3) or len(actions) <= row or 0 in actions.shape:
            raise ValueError(
                f"policy '{self._name}': act() returned actions of shape {actions.shape}; expected (rows, n) or (rows, H, n)"
            )
        return actions[row].reshape(-1, actions.shape[-1])

    def _joined(self, given: dict[str, Any], row: int) -> Any:
        """Actions of all move groups, of those of each."""
        for flag in ("done", "hold"):
            if np.any(np.asarray(given.pop(flag, [False] * (row + 1)))[row]):
                raise ValueError(f"policy '{self._name}': act() returned '{flag}', and openpi's protocol has actions only")
        given.pop("success", None)
        if given.keys() == {"action"}:
            return given["action"]
        groups = [] if self._alone else self._groups
        if not groups or given.keys() != set(groups):
            raise ValueError(
                f"policy '{self._name}': act() returned commands for {', '.join(given) or 'no group'}; expected "
                f"{', '.join(groups) or 'an array'}"
            )
        return np.concatenate([as_numbers(given[group]) for group in groups], -1)


class _NoSimulation:
    """In the place of the simulation, which a served policy does not have."""

    def __init__(self, policy: str, num_worlds: int) -> None:
        self.num_worlds = num_worlds
        self._policy = policy

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"policy '{self._policy}' reads sim.{name}, and a served policy has observations only")


def _rows_of(spec: Any, count: int) -> np.ndarray:
    return np.zeros((count, *spec.shape), np.uint8 if spec.is_dict else spec.dtype)


def _text(key: str, value: Any) -> str:
    if not isinstance(value, str):
        raise BadRequest(f"'{key}' is a {type(value).__name__}: must be a text")
    return value


def _integer(message: Mapping[str, Any], key: str, default: int) -> int:
    value = message.get(key, default)
    if type(value) is not int or not 0 <= value < 2**63:
        raise BadRequest(f"'{key}' is {value!r:.80}: must be a number from 0 on")
    return value


def _numbers(message: Mapping[str, Any], place: str = "") -> dict[str, np.ndarray]:
    """Arrays by name: the keys of nested maps are joined by ``/``."""
    found: dict[str, np.ndarray] = {}
    for key, value in message.items():
        name = place + key
        inner = _numbers(value, f"{name}/") if isinstance(value, dict) else {name: _array(name, value)}
        if twice := found.keys() & inner.keys():
            raise BadRequest(f"the observation has '{min(twice)}' twice")
        found |= inner
    return found


def _array(name: str, value: Any) -> np.ndarray:
    try:
        array = np.array(value)  # a copy that can be written to
    except ValueError:
        raise BadRequest(f"'{name}' has lists of different lengths") from None
    if array.dtype.kind not in "biuf":
        raise BadRequest(f"'{name}' is a {type(value).__name__}: must be an array of numbers")
    return array


def _nested(numbers: Mapping[str, np.ndarray], names: list[str] | None) -> dict[str, Any]:
    """Rows ``[1, ...]`` of the sensors or streams of these names, nested by the parts of their names; None: all."""
    chosen = dict(numbers) if names is None else {}
    for name in names or ():
        inside = {one: array for one, array in numbers.items() if one == name or one.startswith(f"{name}/")}
        if not inside:
            raise _missing(name, numbers)
        chosen |= inside
    for name in chosen:
        parts = name.split("/")
        if parent := next((one for i in range(1, len(parts)) if (one := "/".join(parts[:i])) in chosen), None):
            raise BadRequest(f"the observation has '{parent}' and '{name}'")
    return nest({name: tuple(name.split("/")) for name in chosen}, {name: array[None] for name, array in chosen.items()})


def _missing(name: str, numbers: Mapping[str, np.ndarray]) -> BadRequest:
    return BadRequest(f"the observation has no '{name}', which the policy needs{did_you_mean(name, numbers, 'it has')}")
