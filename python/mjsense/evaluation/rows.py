# SPDX-License-Identifier: Apache-2.0
"""A row for each episode of a recording: how it ended, and under which conditions it was played."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from mjsense.core.representations import plain
from mjsense.dataset import Dataset, Episode
from mjsense.dataset.hdf5 import kept_open
from mjsense.evaluation.intervals import wilson

LATENCY = "obs/extra/policy_latency"
_TOO_DEEP = "a contact was too deep"
_TEXT = 1000  # characters of a text


@dataclass(frozen=True)
class Row:
    """One episode. Numbers that a recording does not have are NaN, and texts are empty."""

    episode: int
    """Number of the episode when it was played."""
    house: int
    """Number of the ``house_N`` folder; -1 without one."""
    seed: int
    """Seed of the recording; -1 if it does not state one."""
    success: bool
    """The outcome is ``success``."""
    success_once: bool
    """At least one observation is a success."""
    steps: int
    """Control steps."""
    time_to_success_s: float
    """Time of the observation from which on all are successes; NaN if the episode is not a success. [s]"""
    retries: int
    """Number of times that the policy started again; -1 if the policy does not state it."""
    object: str
    """Kind of the object."""
    scene: str
    """Name of the scene, without its part."""
    split: str
    """Part of the scene: ``train`` or ``test``."""
    light: str
    """Light of the scene, if the task states it."""
    instruction: str
    """The instruction that the policy received."""
    description: str
    """The same task in the words that do not vary."""
    failure: str
    """Why the episode failed, without details in parentheses; empty for a success."""
    collision: bool
    """The episode failed because a contact was deeper than ``max_penetration``."""
    jerk: float
    """Root mean square of the third derivative of the tool's position. [m/s^3]"""
    idle: float
    """Share of the steps in which nothing moves."""
    latency_s: float
    """Mean time from an observation to the policy's answer. [s]"""
    position: int
    """Position in the recording: ``mjs.Dataset(...).episodes`` has it under this number."""


def key_of(row: Row) -> tuple[int, int, int]:
    """What identifies an episode in recordings of the same settings."""
    return row.house, row.seed, row.episode


def rows_of(dataset: Dataset) -> list[Row]:
    """The rows of all episodes of a data set."""
    rows = []
    for path, episodes in itertools.groupby(dataset.episodes, lambda episode: episode.path):
        with kept_open(path):
            rows += [_row(episode) for episode in episodes]
    return rows


def _row(episode: Episode) -> Row:
    scene, settings, streams = episode.obs_scene, episode.settings, episode.streams
    flags = np.asarray(episode["success"], bool) if "success" in streams else np.zeros(episode.length, bool)
    name, _, part = _word(settings.get("scene")).partition("@")
    given, asked = _numbers(episode, "obs/extra/policy_num_retries"), _numbers(episode, LATENCY)
    quality = episode.quality
    return Row(
        episode=episode.number,
        house=-1 if episode.house is None else episode.house,
        seed=-1 if episode.seed is None else episode.seed,
        success=episode.success,
        success_once=bool(flags.any()) or episode.success,
        steps=max(0, episode.length - 1),
        time_to_success_s=_time_to_success(flags, float(episode.fps)) if episode.success else math.nan,
        retries=int(given[-1]) if len(given) and 0 <= given[-1] < 2**31 else -1,
        object=_word(scene.get("object_name")),
        scene=name,
        split=_word(settings.get("split")) or part,
        light=_word(scene.get("light")),
        instruction=_word(episode.task),
        description=_word(scene.get("task_description")),
        failure="" if episode.success else _word(episode.outcome).partition(" (")[0],
        collision=_TOO_DEEP in episode.outcome,
        jerk=quality.jerk,
        idle=quality.idle,
        latency_s=float(asked.mean()) if len(asked) else math.nan,
        position=episode.index,
    )


def _numbers(episode: Episode, name: str) -> np.ndarray:
    """The finite numbers of a stream of one number; none without the stream."""
    if name not in episode.streams:
        return np.zeros(0)
    values = np.asarray(episode[name], float).reshape(-1)
    return values[np.isfinite(values)]


def _time_to_success(flags: np.ndarray, fps: float) -> float:
    """Time of the first observation of the last successes. The outcome may be a success without such observations."""
    if not len(flags) or not flags[-1]:
        return math.nan
    failures = np.flatnonzero(~flags)
    return float(failures[-1] + 1 if len(failures) else 0) / fps


def _word(value: Any) -> str:
    return plain(value, _TEXT) if isinstance(value, str) else ""


@dataclass(frozen=True)
class Group:
    """Episodes that have a value in common."""

    name: str
    episodes: int
    successes: int

    @property
    def rate(self) -> float:
        """Share of successes; NaN without episodes."""
        return self.successes / self.episodes if self.episodes else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the success rate."""
        return wilson(self.successes, self.episodes)


def group_of(rows: Iterable[Row], name: str = "") -> Group:
    """All of these episodes as one group."""
    flags = [row.success for row in rows]
    return Group(name, len(flags), sum(flags))


def groups_by(rows: Iterable[Row], column: str) -> list[Group]:
    """The groups of equal values of a column, in the order of their names. Episodes with an empty text are in no group."""
    values: dict[Any, list[Row]] = {}
    for row in rows:
        values.setdefault(getattr(row, column), []).append(row)
    named = {str(value): inner for value, inner in values.items() if value != ""}
    return [group_of(named[name], name) for name in sorted(named)]
