# SPDX-License-Identifier: Apache-2.0
"""The recorded actions of the same episodes as a policy: an upper bound of what can be reproduced."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mjsense.core.counted import counted
from mjsense.dataset import Dataset
from mjsense.dataset.episode import Episode
from mjsense.tasks.policy import Policy

_COMMAND, _TARGET = "actions/commanded_action", "actions/joint_pos"


@dataclass
class _Recorded:
    """The actions of an episode, ``T`` steps of ``G`` move groups."""

    actions: np.ndarray
    """``[T, n]``"""
    hold: np.ndarray
    """Groups without a command, bool ``[T, G]``."""
    success: np.ndarray
    """The policy's own verdict ``[T]``; NaN: none."""
    ended: bool
    """Whether the episode ended before its horizon."""


class ReplayedPolicy(Policy):
    """Repeats the actions of a recording in the episodes with the same seed and number.

    Files contain commands as float32. If the commands of a move group are joint positions, the targets of its controller are
    used, which are recorded as float64 except in the last step of an episode that ended before its horizon. Until then the
    episode repeats bit for bit. ``action_noise`` is that of the recording: the noise depends on the seed and the episode only.
    """

    name = "replay"
    observation = ()

    def __init__(self, path: str) -> None:
        self.path = str(path)
        self.data = Dataset(self.path)
        self.episodes: dict[tuple[int | None, int], Episode] = {(e.seed, e.number): e for e in self.data.episodes}
        if not self.episodes:
            raise ValueError(f"replay: '{path}' has no episodes")
        self.settings: dict[str, Any] = self.data.episodes[0].settings
        self._playing: dict[int, _Recorded] = {}

    def fingerprint(self) -> str:
        return str([(e.seed, e.number, e.length, e.outcome) for e in self.data.episodes])

    def check(self, settings: dict[str, Any], numbers: Iterable[int]) -> None:
        """Raises ValueError if the recording was made with other settings, which are given by their names, or lacks one of these
        episodes."""
        for name, value in settings.items():
            recorded = self.settings.get(name, value)
            if recorded != value:
                raise ValueError(f"replay: '{self.path}' was recorded with {name} = {recorded!r}, but it would be {value!r} now")
        if missing := set(numbers) - {number for _, number in self.episodes}:
            raise ValueError(f"replay: '{self.path}' has no episode {min(missing)}; {self._contents()}")

    def initialize(self) -> None:
        self._step = np.zeros(self.num_worlds, np.int64)

    def _mjs_reset(self, ids: list[int], episodes: list[int], seed: int, instructions: list[str]) -> None:
        for world, number in zip(ids, episodes, strict=True):
            if (seed, number) not in self.episodes:
                raise ValueError(f"replay: '{self.path}' has no episode {number} of seed {seed}; {self._contents()}")
            self._playing[world] = _recorded(self.episodes[seed, number], self.action_groups)
        self._step[ids] = 0
        super()._mjs_reset(ids, episodes, seed, instructions)

    def _contents(self) -> str:
        seeds = sorted({str(seed) for seed, _ in self.episodes})
        numbers = sorted(number for _, number in self.episodes)
        return f"it has {counted(len(numbers), 'episode')} between {numbers[0]} and {numbers[-1]}, of seed {', '.join(seeds[:5])}"

    def act(self, obs: dict[str, Any]) -> dict[str, np.ndarray]:
        actions = np.zeros((self.num_worlds, len(self.action_low)))
        hold = np.zeros((self.num_worlds, len(self.action_groups)), bool)
        done, success = np.zeros(self.num_worlds, bool), np.full(self.num_worlds, np.nan)
        for world in np.flatnonzero(self.wanted).tolist():
            recorded, step = self._playing[world], int(self._step[world])
            if step >= len(recorded.actions):  # this evaluation plays on after the end of the recorded episode
                hold[world], done[world] = True, True
                continue
            actions[world], hold[world], success[world] = recorded.actions[step], recorded.hold[step], recorded.success[step]
            done[world] = recorded.ended and step == len(recorded.actions) - 1
        self._step[self.wanted] += 1
        return {"action": actions, "hold": hold, "done": done, "success": success}


def _recorded(episode: Episode, groups: dict[str, slice]) -> _Recorded:
    """Row t of the actions led to observation t; row 0 has none."""
    steps = episode.length - 1
    n = max((at.stop for at in groups.values()), default=0)
    actions, hold = np.zeros((steps, n)), np.ones((steps, len(groups)), bool)
    for i, (name, at) in enumerate(groups.items()):
        if f"{_COMMAND}/{name}" not in episode:
            continue
        given = episode[f"{_COMMAND}/given/{name}"][1:].astype(bool)
        commands = episode[f"{_COMMAND}/{name}"][1:]
        if commands.shape[1] != at.stop - at.start:
            raise ValueError(
                f"replay: {commands.shape[1]} commands of move group '{name}' are recorded, but it takes {at.stop - at.start} now"
            )
        if f"{_TARGET}/{name}" in episode:
            targets, known = episode[f"{_TARGET}/{name}"][1:], episode[f"{_TARGET}/given/{name}"][1:].astype(bool)
            if targets.shape == commands.shape and np.array_equal(targets[known].astype(commands.dtype), commands[known]):
                commands = np.where(known[:, None], targets, commands)
        actions[given, at], hold[:, i] = commands[given], ~given
    verdicts = f"{_COMMAND}/given/success"
    success = np.full(steps, np.nan)
    if verdicts in episode:
        given = episode[verdicts][1:].astype(bool)
        success[given] = episode[f"{_COMMAND}/success"][1:][given].reshape(-1)
    return _Recorded(actions, hold, success, bool(episode["terminated"][-1]))


def policy_of(text: str) -> ReplayedPolicy:
    """The policy of ``replay:DIR``."""
    return ReplayedPolicy(text.partition(":")[2])
