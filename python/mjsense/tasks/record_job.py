# SPDX-License-Identifier: Apache-2.0
"""Recording of episodes by this process, with options in a dict."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.core import representations
from mjsense.core.declared_fields import declared_fields
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.core.installed_files import use_installed_meshes
from mjsense.core.progress_line import clock, line_of
from mjsense.recording.ffmpeg import use_installed_ffmpeg
from mjsense.sim.simulation import Simulation
from mjsense.tasks.parts import parts_of

PARTS: dict[str, Any] = {"task": "pick", "robot": None, "policy": "planner", "scene": "", "resume": False, "append": False}
"""Defaults of the options that decide which parts a recording has."""


@dataclass(frozen=True)
class RecordProgress:
    """Progress of a recording."""

    kept: int
    """Number of episodes on disk."""
    wanted: int
    running: int
    succeeded: int
    """Successful attempts of this run."""
    failed: int
    steps: int
    """Control steps of all worlds."""
    physics_steps: int
    frames: int
    """Images of all cameras."""
    seconds: float
    """Wall-clock time."""
    seconds_left: float
    """Estimated remaining time; NaN until an episode has ended."""


def of_recording(p: RecordProgress) -> str:
    """``3/10 episodes  75 % success  412 steps/s  0:41 left``, as the program shows it."""
    ended, seconds = p.succeeded + p.failed, max(p.seconds, 1e-9)
    parts = [
        f"{p.kept}/{p.wanted} episodes",
        f"{100 * p.succeeded / ended:.0f} % success" if ended else "",
        f"{p.steps / seconds:.0f} steps/s",
    ]
    parts.append(f"{p.frames / seconds:.0f} frames/s" if p.frames else "")
    parts.append(f"{clock(p.seconds_left)} left" if p.seconds_left == p.seconds_left and p.kept < p.wanted else "")
    return "  ".join(filter(None, parts))


@dataclass(frozen=True)
class RecordSummary(RecordProgress):
    """Result of a recording."""

    interrupted: bool
    enough: bool
    """All requested episodes are on disk."""
    failures: dict[str, int]
    """Number of failed attempts by reason."""
    lengths: list[int]
    """Number of observations of each ended attempt."""
    times: dict[str, float]
    """Wall-clock seconds by activity: policy, physics, sensing, rendering, reset, recording."""
    published_bytes: int
    path: Path
    """Folder of the episodes."""

    def _repr_html_(self) -> str:
        """HTML for notebooks: the numbers, and the reasons of failures."""
        ended = self.succeeded + self.failed
        facts = [
            ("episodes on disk", f"{self.kept} of {self.wanted}"),
            ("attempts of this run", f"{ended}, {self.succeeded} successful"),
            ("steps", f"{self.steps} in {self.seconds:.1f} s"),
            ("size", f"{self.published_bytes / 1e6:.1f} MB"),
            ("folder", self.path),
        ]
        failures = representations.grid(
            ("attempts", "reason of the failure"), [(count, reason) for reason, count in self.failures.items()]
        )
        times = representations.grid(("activity", "s"), [(name, f"{seconds:.2f}") for name, seconds in self.times.items()])
        state = " (interrupted)" if self.interrupted else ""
        return representations.block(
            f"recording{state}", representations.grid(("", ""), facts) + (failures if self.failures else ""), {"times": times}
        )


def check_names(options: Iterable[str]) -> None:
    """Raises UnknownNameError that names an option which a recording does not have."""
    known = {"worlds", *declared_fields("RecordJobCfg")}
    for name in options:
        if name not in known:
            raise UnknownNameError(f"record: unknown option '{name}'{did_you_mean(name, known)}")


def record_here(
    options: dict[str, Any], sensors: Iterable[Any] = (), progress: bool | Callable[[RecordProgress], None] | None = None
) -> RecordSummary:
    """Records episodes. See :func:`mjsense.record`.

    Args:
        options: Options of ``mjsense.record`` by name; ``out`` and those that differ from the defaults.
    """
    line = line_of(progress)
    show = progress if callable(progress) else None if line is None else lambda p: line.show(of_recording(p))
    made = job_result(options, sensors, None if show is None else lambda p: show(RecordProgress(**p)))
    del made["work"]
    summary = RecordSummary(**made)
    if line is not None:
        line.show(of_recording(summary), last=True)
    return summary


def job_result(
    options: dict[str, Any], sensors: Iterable[Any], report: Callable[..., None] | None, *, stop_on_signals: bool = False
) -> dict[str, Any]:
    """Records episodes. Returns the fields of a RecordSummary, and ``work``: what ran in addition to the simulation.

    Args:
        report: Called with the fields of a RecordProgress; with ``stop_on_signals`` also with the number of signals.
        stop_on_signals: The first Ctrl-C or SIGTERM finishes the running episodes, the second discards them, the third ends the
            process. Otherwise Ctrl-C discards them and raises KeyboardInterrupt.
    """
    options = {**PARTS, **options, "out": str(options["out"])}
    objects = parts_of(options, sensors)
    if options.get("meshes") == "real":
        use_installed_meshes()
    use_installed_ffmpeg()
    return _core.record(options, report, objects, Simulation._of, stop_on_signals)
