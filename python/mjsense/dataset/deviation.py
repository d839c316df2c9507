# SPDX-License-Identifier: Apache-2.0
"""Where a replay differs from its recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Deviation:
    """The first place at which a replayed value differs from the recorded one."""

    step: int
    """Observation."""
    field: str
    """Part of the state (``qpos``, ``qvel``, ``act``, ``ctrl`` and so on), or a stream (``obs/extra/tcp_pose``)."""
    element: str
    """Joint, body, actuator or equality constraint, and the index inside it; of a stream the index, pixel or key."""
    recorded: Any
    replayed: Any
    count: int
    """Number of values that differ at this step."""

    def __str__(self) -> str:
        numbers = all(isinstance(value, (int, float)) for value in (self.recorded, self.replayed))
        difference = f"difference {self.replayed - self.recorded:.3g}; " if numbers else ""
        return (
            f"step {self.step}: {self.field} of {self.element}: recorded {self.recorded!r}, replayed {self.replayed!r} "
            f"({difference}{self.count} values differ at this step)"
        )
