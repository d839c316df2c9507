# SPDX-License-Identifier: Apache-2.0
"""Two policies compared on the same episodes."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.errors import printable
from mjsense.dataset import Dataset, Episode
from mjsense.evaluation.facts import evaluation_of, settings_of
from mjsense.evaluation.intervals import episodes_needed, mcnemar, paired_difference
from mjsense.evaluation.report import Results, results
from mjsense.evaluation.rows import Row, group_of, key_of
from mjsense.evaluation.summary import rate_text

_NEEDED = (0.02, 0.05, 0.1, 0.2)
"""Differences for which the text says how many episodes show them."""
_STARTS = ("obs/agent/qpos/", "env_states/actors/", "env_states/articulations/")
"""Streams whose first rows are the start of an episode."""
_SHOWN = 5


@dataclass(frozen=True)
class Comparison:
    """The result of :func:`compare`. ``print(comparison)`` is its text."""

    a: Results
    b: Results
    pairs: list[tuple[Row, Row]]
    """The episodes that both have played."""
    left_out: int
    """Number of episodes that only one of them has played."""

    @property
    def only_a(self) -> int:
        """Number of pairs in which only A succeeds."""
        return sum(a.success and not b.success for a, b in self.pairs)

    @property
    def only_b(self) -> int:
        """Number of pairs in which only B succeeds."""
        return sum(b.success and not a.success for a, b in self.pairs)

    @property
    def difference(self) -> float:
        """Success rate of B minus that of A."""
        return (self.only_b - self.only_a) / len(self.pairs)

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the difference, by a bootstrap over the pairs. It is the same in every call."""
        return paired_difference(self.only_a, self.only_b, len(self.pairs))

    @property
    def p_value(self) -> float:
        """McNemar's exact test: probability of so different results, or more different ones, of policies with equal success
        rates."""
        return mcnemar(self.only_a, self.only_b)

    def episodes_needed(self, difference: float) -> int:
        """Number of episodes that show a difference of the success rates with a probability of 80 %, at the level of 5 %."""
        # One pair is added, so that few pairs without a difference do not promise that no pairs differ.
        return episodes_needed(difference, (self.only_a + self.only_b + 1) / (len(self.pairs) + 1))

    def __str__(self) -> str:
        low, high = self.interval
        names = [str(one.dataset.root) for one in (self.a, self.b)]
        lines = [
            f"{letter}  {rate_text(group_of([pair[i] for pair in self.pairs]))}   {dict(one.facts).get('policy', '')} ({name})"
            for i, (letter, one, name) in enumerate(zip("AB", (self.a, self.b), names))
        ]
        lines += [
            f"B - A  {self.difference:+.1%} [{low:+.1%}, {high:+.1%}]   (95 % interval: paired bootstrap)",
            f"only A succeeds in {self.only_a}, only B in {self.only_b} of {len(self.pairs)} episodes; McNemar's "
            f"exact test: p = {self.p_value:.3g}",
        ]
        lines += [f"left out: {counted(self.left_out, 'episode')} that only one of them has played"] if self.left_out else []
        needed = ", ".join(f"{self.episodes_needed(one)} ({one:.0%})" for one in _NEEDED)
        lines.append(f"episodes that show a difference with a probability of 80 %: {needed}")
        return printable("\n".join(lines))


@checked
def compare(a: str | Path | Dataset, b: str | Path | Dataset, *, allow: Iterable[str] = ()) -> Comparison:
    """Compares two evaluations on the episodes that both have played.

    Args:
        a: An evaluation or recording: its folder, or a :class:`Dataset`.
        b: Another one, of the same episodes with another policy.
        allow: Names of settings that may differ, such as ``cameras``, in addition to the policy.

    Raises:
        ValueError: The settings differ, failed episodes were not kept, no episode is in both, or an episode starts differently.
            The text says which.
    """
    of_a, of_b = results(a), results(b)
    for one in (of_a, of_b):
        if one.warnings:
            raise ValueError(f"compare(): {one.dataset.root}: {one.warnings[0]}")
    if different := _differences(of_a.dataset, of_b.dataset, set(allow)):
        shown = "; ".join(different[:_SHOWN]) + (f"; and {len(different) - _SHOWN} more" if len(different) > _SHOWN else "")
        raise ValueError(
            f"compare(): {of_a.dataset.root} and {of_b.dataset.root} differ in more than the policy: {shown}; "
            "allow=[...] (--allow NAME) accepts settings that may differ"
        )
    rows_b = {key_of(row): row for row in of_b.rows}
    pairs = [(row, rows_b[key_of(row)]) for row in of_a.rows if key_of(row) in rows_b]
    if not pairs:
        raise ValueError(
            f"compare(): {of_a.dataset.root} and {of_b.dataset.root} have no episode in common (house, seed and number)"
        )
    _check_starts(of_a.dataset, of_b.dataset, pairs)
    return Comparison(of_a, of_b, pairs, len(of_a.rows) + len(of_b.rows) - 2 * len(pairs))


def _differences(a: Dataset, b: Dataset, allowed: set[str]) -> list[str]:
    """Settings of two recordings that differ, the policy excepted: ``"horizon is 500 and 200"``."""
    tables = [_compared(dataset) for dataset in (a, b)]
    found = []
    for name in sorted(tables[0].keys() | tables[1].keys()):
        values = [table.get(name, "not stated") for table in tables]
        if values[0] != values[1] and not any(name == one or name.startswith(f"{one}.") for one in allowed):
            found.append(f"{name} is {_short(values[0])} and {_short(values[1])}")
    return found


def _compared(dataset: Dataset) -> dict[str, Any]:
    """The settings that must be equal, by name. Those of several houses are a list."""
    tables: dict[str, list[Any]] = {}
    for settings in settings_of(dataset):
        code = settings.get("code")
        if isinstance(code, dict):
            settings["code"] = {name: inner for name, inner in code.items() if name != "policy"}
        for name, value in _flat(settings):
            if name != "policy" and value != {}:
                tables.setdefault(name, []).append(value)
    evaluation = evaluation_of(dataset.root)
    for part in ("benchmark", "settings"):
        for name, value in _flat(evaluation.get(part) or {}):
            tables.setdefault(f"benchmark.{name}" if part == "benchmark" else name, []).append(value)
    return {name: sorted({json.dumps(value, sort_keys=True) for value in values}) for name, values in tables.items()}


def _flat(table: dict[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    found = []
    for key, value in table.items():
        found += _flat(value, f"{prefix}{key}.") if isinstance(value, dict) and value else [(f"{prefix}{key}", value)]
    return found


def _short(value: Any) -> str:
    text = ", ".join(value) if isinstance(value, list) else str(value)
    return text if len(text) <= 80 else text[:79] + "\N{HORIZONTAL ELLIPSIS}"


def _check_starts(a: Dataset, b: Dataset, pairs: list[tuple[Row, Row]]) -> None:
    """Raises ValueError if an episode does not begin in the same state in both."""
    of_a, of_b = ({episode.index: episode for episode in dataset.episodes} for dataset in (a, b))
    for row_a, row_b in pairs:
        first, second = of_a[row_a.position], of_b[row_b.position]
        for name in [name for name in first.streams if name.startswith(_STARTS) and name in second.streams]:
            if not np.array_equal(_first(first, name), _first(second, name), equal_nan=True):
                raise ValueError(
                    f"compare(): episode {row_a.episode} starts differently in {a.root} and {b.root}: '{name}' differs. "
                    "Were they recorded by different versions?"
                )


def _first(episode: Episode, name: str) -> np.ndarray:
    return np.asarray(episode[name][:1], float)
