# SPDX-License-Identifier: Apache-2.0
"""Results of an evaluation as text."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from mjsense.core.errors import printable
from mjsense.evaluation.rows import Group, Row, group_of, groups_by

GROUPED = {
    "object": "object",
    "scene": "scene",
    "split": "split",
    "light": "light",
    "house": "house",
    "instruction": "instruction",
}
"""Columns by which successes are counted, and their words."""
_GROUPS = 20
"""Maximum number of groups in a text."""


def tables_of(rows: Sequence[Row]) -> dict[str, list[Group]]:
    """The groups of each column of :data:`GROUPED` that divides the episodes. Of instructions of which nearly all differ, the
    description of the task takes the place."""
    found = {word: groups_by(rows, column) for column, word in GROUPED.items()}
    if len(found["instruction"]) > len(rows) / 2:
        found["instruction"] = groups_by(rows, "description")
    if [[g.episodes, g.successes] for g in found["instruction"]] == [[g.episodes, g.successes] for g in found["object"]]:
        del found["instruction"]  # the same groups under another name
    return {word: groups for word, groups in found.items() if len(groups) > 1}


def failures_of(rows: Sequence[Row]) -> list[tuple[str, int]]:
    """Reasons of failures and their numbers, the most frequent first."""
    return sorted(Counter(row.failure for row in rows if not row.success).items(), key=lambda item: (-item[1], item[0]))


def figures_of(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """Names and texts of the figures of all episodes."""
    times = _finite([row.time_to_success_s for row in rows])
    retries = [row.retries for row in rows if row.retries >= 0]
    latency, jerk = _finite([row.latency_s for row in rows]), _finite([row.jerk for row in rows])
    once = sum(row.success_once for row in rows)
    shown = [
        (
            "time to success, median (5 %, 95 %)",
            times and "{1:.1f} s ({0:.1f}, {2:.1f})".format(*np.quantile(times, (0.05, 0.5, 0.95))),
        ),
        ("success at some observation", once and f"{once} of {len(rows)}"),
        ("episodes with retries", retries and f"{sum(map(bool, retries))} of {len(retries)}"),
        ("failed by a deep contact", f"{sum(row.collision for row in rows)} of {len(rows)}"),
        ("jerk of the tool, median", jerk and f"{np.median(jerk):.1f} m/s³"),
        ("latency of the policy, mean", latency and f"{1000 * np.mean(latency):.1f} ms"),
    ]
    return [(name, text) for name, text in shown if text]


def rate_text(group: Group) -> str:
    """``41 of 50   82 % [69, 90]``"""
    if not group.episodes:
        return "no episodes"
    low, high = group.interval
    return f"{group.successes} of {group.episodes}   {group.rate:.1%} [{low:.1%}, {high:.1%}]"


def text_of(rows: Sequence[Row], facts: Sequence[tuple[str, str]], warnings: Sequence[str]) -> str:
    """The report for a terminal."""
    lines = [f"warning: {warning}" for warning in warnings]
    lines += [f"{name:36}  {text}" for name, text in facts]
    lines += ["", f"{'success':36}  {rate_text(group_of(rows))}   (95 % intervals: Wilson)"]
    lines += [f"{name:36}  {text}" for name, text in figures_of(rows)]
    for word, groups in tables_of(rows).items():
        width = min(60, max(len(group.name) for group in groups[:_GROUPS]))
        lines += ["", f"by {word}"]
        lines += [f"  {_short(group.name, width):{width}}  {rate_text(group)}" for group in groups[:_GROUPS]]
        if len(groups) > _GROUPS:
            lines.append(f"  ... {len(groups) - _GROUPS} more in results.parquet")
    if reasons := failures_of(rows):
        lines += ["", "failures", *(f"  {count:4}  {reason}" for reason, count in reasons)]
    return printable("\n".join(lines))


def _short(text: str, width: int) -> str:
    return text if len(text) <= width else text[: width - 1] + "\N{HORIZONTAL ELLIPSIS}"


def _finite(values: Sequence[float]) -> list[float]:
    return [value for value in values if math.isfinite(value)]
