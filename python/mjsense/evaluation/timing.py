# SPDX-License-Identifier: Apache-2.0
"""When the actions of a policy are executed: chunks, how much of them, averages of several, and delay."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import gymnasium
import numpy as np

from mjsense.core.arguments import checked
from mjsense.evaluation.policies import policy_from
from mjsense.sensors.sensor import Sensor
from mjsense.tasks.policy import Policy

Latency = float | Literal["measured"]
"""Seconds from an observation to the first action of its answer, or ``measured``: the wall-clock time of the call."""


@dataclass
class _Answer:
    """Actions of one call for one world."""

    arrival: int
    """Step at which the first of them can be executed."""
    actions: np.ndarray
    """``[H, n]``"""
    hold: np.ndarray
    """Move groups that hold their position, bool ``[G]``."""
    done: bool
    success: float
    """The policy's own verdict; NaN: none."""


class Timed(Policy):
    """Another policy whose chunks of actions are executed as on a robot.

    The policy is called at an observation and answers with ``H`` actions. ``execution_horizon`` of them are executed, then it is
    called again (by default all). With a latency of ``L`` steps, every action is executed ``L`` steps later than without it;
    until the first answer arrives, the robot holds its position, later it executes what is left of the previous answers and then
    holds.

    Args:
        policy: The policy that is called.
        execution_horizon: Number of actions of a chunk that are executed before the policy is called again; None: all.
        ensemble: None: the newest answer is executed. A number ``m``: the mean of all answers that have an action for the step,
            with the weights ``exp(-m * i)``, ``i = 0`` for the oldest.
        latency: Delay of the answers, rounded up to whole control steps. [s]
    """

    def __init__(
        self, policy: Policy, *, execution_horizon: int | None = None, ensemble: float | None = None, latency: Latency = 0.0
    ) -> None:
        if execution_horizon is not None and execution_horizon < 1:
            raise ValueError(f"execution_horizon is {execution_horizon}: must be at least 1")
        if ensemble is not None and not 0 <= ensemble < math.inf:
            raise ValueError(f"ensemble is {ensemble}: must be a number from 0 on")
        if latency != "measured" and not (isinstance(latency, (int, float)) and 0 <= latency < math.inf):
            raise ValueError(f"latency is {latency!r}: must be seconds from 0 on, or 'measured'")
        self.policy = policy
        self.name = policy._mjs_name()
        self.observation, self.phases = policy.observation, policy.phases
        self.execution_horizon, self.ensemble, self.latency = execution_horizon, ensemble, latency
        fingerprint = getattr(policy, "fingerprint", None)
        if callable(fingerprint):
            self.fingerprint = lambda: f"{fingerprint()} {execution_horizon} {ensemble} {latency}"

    # Steps since the beginning of the episode, and the step at which the policy is called next: int [B].
    _mjs_step: np.ndarray
    _mjs_next: np.ndarray

    def _mjs_bind(self, sim: Any, streams: list[Any], layout: list[Any]) -> tuple[dict[str, Any], np.ndarray]:
        self._mjs_seen, self._mjs_asked = self.policy._mjs_bind(sim, streams, layout)
        bound = super()._mjs_bind(sim, streams, layout)
        self._mjs_step, self._mjs_next = (np.zeros(self.num_worlds, np.int64) for _ in range(2))
        self._mjs_answers: list[deque[_Answer]] = [deque() for _ in range(self.num_worlds)]
        self._mjs_delays = np.full(self.num_worlds, np.nan, np.float32)
        return bound

    def _mjs_reset(self, ids: list[int], episodes: list[int], seed: int, instructions: list[str]) -> None:
        super()._mjs_reset(ids, episodes, seed, instructions)
        self._mjs_step[ids], self._mjs_next[ids], self._mjs_delays[ids] = 0, 0, np.nan
        for world in ids:
            self._mjs_answers[world].clear()
        self.policy._mjs_reset(ids, episodes, seed, instructions)
        self.phase, self.num_retries = self.policy.phase, self.policy.num_retries

    def sensors(self) -> Iterable[Any]:
        own = self.policy._mjs_make_sensors()
        return [*own, _LatencySensor(self)] if self.latency else own

    def info(self, world: int) -> Mapping[str, str]:
        return self.policy.info(world)

    def failure(self, world: int) -> str:
        return self.policy.failure(world)

    def act(self, obs: dict[str, Any]) -> Any:
        due = self.wanted & (self._mjs_step >= self._mjs_next)
        self._mjs_delays[self.wanted] = np.nan
        if due.any():
            self._ask(due)
        actions = np.zeros((self.num_worlds, len(self.action_low)))
        hold, done = np.zeros((self.num_worlds, len(self.action_groups)), bool), np.zeros(self.num_worlds, bool)
        success = np.full(self.num_worlds, np.nan)
        for world in np.flatnonzero(self.wanted).tolist():
            found = self._action(world)
            if found is None:
                hold[world] = True
                continue
            actions[world], newest, ends = found
            hold[world] = newest.hold
            if ends:
                done[world], success[world] = newest.done, newest.success
        self._mjs_step[self.wanted] += 1
        return {"action": actions, "hold": hold, "done": done, "success": success}

    def _ask(self, due: np.ndarray) -> None:
        """Asks the policy for these worlds: bool ``[B]``."""
        self._mjs_asked[:] = due
        begun = time.perf_counter()
        given = self.policy.act(self._mjs_seen)
        seconds = time.perf_counter() - begun if self.latency == "measured" else float(self.latency)
        self.phase, self.num_retries = self.policy.phase, self.policy.num_retries
        chunk, hold, done, success = self._read(given)
        executed = self.execution_horizon or chunk.shape[1]
        if executed > chunk.shape[1]:
            raise ValueError(
                f"policy '{self.name}': the execution horizon is {executed}, but act() returned chunks of "
                f"{chunk.shape[1]} actions"
            )
        late = math.ceil(seconds / self.sim.step_dt - 1e-9)
        self._mjs_delays[due] = seconds
        for world in np.flatnonzero(due).tolist():
            self._mjs_answers[world].append(
                _Answer(int(self._mjs_step[world]) + late, chunk[world], hold[world], bool(done[world]), float(success[world]))
            )
        self._mjs_next[due] = self._mjs_step[due] + executed

    def _action(self, world: int) -> tuple[np.ndarray, _Answer, bool] | None:
        """The action of this step ``[n]``, the newest answer, and whether its last executed action is this one; None: there is no
        action."""
        step, answers = int(self._mjs_step[world]), self._mjs_answers[world]
        arrived = [answer for answer in answers if answer.arrival <= step < answer.arrival + len(answer.actions)]
        while answers and answers[0].arrival + len(answers[0].actions) <= step + 1:
            answers.popleft()
        if not arrived:
            return None
        newest = arrived[-1]
        ends = step - newest.arrival + 1 == (self.execution_horizon or len(newest.actions))
        if self.ensemble is None:
            action = newest.actions[step - newest.arrival]
        else:
            weights = np.exp(-self.ensemble * np.arange(len(arrived)))
            action = (weights / weights.sum()) @ np.stack([answer.actions[step - answer.arrival] for answer in arrived])
        return action, newest, ends

    def _read(self, given: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Actions ``[B, H, n]``, hold ``[B, G]``, done ``[B]`` and success ``[B]``, of what ``act`` returned."""
        groups = dict(given) if isinstance(given, Mapping) else {"action": given}
        done = np.array(groups.pop("done", np.zeros(self.num_worlds)), bool)
        success = np.array(groups.pop("success", np.full(self.num_worlds, np.nan)), float)
        hold = np.zeros((self.num_worlds, len(self.action_groups)), bool)
        hold |= (
            np.array(groups.pop("hold", False), bool).reshape(-1, 1) if np.ndim(groups.get("hold", 0)) < 2 else groups.pop("hold")
        )
        if "action" in groups:
            chunk = self._chunk("", groups.pop("action"), len(self.action_low))
        elif missing := self.action_groups.keys() - groups.keys():
            raise ValueError(
                f"policy '{self.name}': act() returned no command for '{min(missing)}'; execution horizon, "
                "ensembling and latency need "
                "commands for all move groups"
            )
        else:
            parts = {name: self._chunk(name, groups.pop(name), at.stop - at.start) for name, at in self.action_groups.items()}
            chunk = np.concatenate(list(parts.values()), -1)
        if groups:
            raise ValueError(f"policy '{self.name}': act() returned '{min(groups)}', which is not a move group")
        return chunk, hold, done, success

    def _chunk(self, group: str, values: Any, width: int) -> np.ndarray:
        array = np.array(values, np.float64)
        if array.ndim == 2:
            array = array[:, None]
        if array.ndim != 3 or array.shape[0] != self.num_worlds or array.shape[2] != width or not array.shape[1]:
            raise ValueError(
                f"policy '{self.name}': act() returned {f'{group} of ' if group else ''}shape {np.shape(values)}, expected "
                f"({self.num_worlds}, {width}) or ({self.num_worlds}, H, {width})"
            )
        return array


def timed(
    policy: Policy | str, execution_horizon: int | None, ensemble: float | None, latency: Latency
) -> tuple[Policy | str, dict[str, Any]]:
    """The policy with this timing, and what of it was chosen, here or by the policy itself."""
    chosen = {
        "execution_horizon": getattr(policy, "execution_horizon", None) if execution_horizon is None else execution_horizon,
        "ensemble": getattr(policy, "ensemble", None) if ensemble is None else ensemble,
        "latency": latency or None,
    }
    chosen = {name: value for name, value in chosen.items() if value is not None}
    if not chosen:
        return policy, {}
    if not isinstance(policy, Policy):
        raise ValueError(f"policy '{policy}' is computed together with its episode: it has neither chunks nor latency")
    return Timed(policy, **chosen), chosen


@checked
def wrap_policy(
    policy: Any,
    *,
    policy_options: Mapping[str, Any] | None = None,
    execution_horizon: int | None = None,
    ensemble: float | None = None,
    latency: float | Literal["measured"] = 0.0,
) -> Policy | str:
    """The policy of :func:`mjsense.evaluate` for loops of ``env.step``: everything with an argument ``policy`` takes the result.

    ::

        env = mjs.make("pick", policy=mjs.wrap_policy("lerobot:run/checkpoints/last/pretrained_model", latency=0.1))
        observation, info = env.reset(seed=0)
        observation, reward, terminated, truncated, info = env.step(env.expert_action())

    The arguments are those of :func:`mjsense.evaluate`.
    """
    return timed(policy_from(policy, **(policy_options or {})), execution_horizon, ensemble, latency)[0]


class _LatencySensor(Sensor):
    """Delay of the answer to the previous observation; NaN if the policy was not asked."""

    uuid = "policy_latency"
    unit = "s"
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (), np.float32)

    def __init__(self, policy: Timed) -> None:
        super().__init__()
        self._policy = policy

    def compute(self, sim: Any, world_ids: np.ndarray) -> np.ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self._policy._mjs_delays[world_ids]
