# SPDX-License-Identifier: Apache-2.0
"""Recordings on Ray with the arguments, the progress and the result of :func:`mjsense.record`."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mjsense.cluster.driver import ClusterProgress, record_on_ray
from mjsense.cluster.job import Job
from mjsense.core.progress_line import line_of
from mjsense.tasks.record_job import RecordProgress, RecordSummary, of_recording


def record_from_options(
    options: dict[str, Any], address: str, progress: bool | Callable[[RecordProgress], None] | None
) -> RecordSummary:
    """``mjsense.record(..., ray=address)``."""
    own = {name: options.pop(name) for name in ("out", "episodes", "max_attempts", "resume")}
    attempts = tuple(options.pop("attempts"))
    if attempts:
        if not options["keep_failures"]:
            raise ValueError("record: attempts can be combined with ray only with keep_failures=True")
        own["episodes"] = own["max_attempts"] = len(attempts)
    for name in ("shard", "append", "overwrite", "first_attempt", "num_attempts"):
        del options[name]
    if not options["threads"]:
        del options["threads"]  # one per worker

    def counts(now: ClusterProgress) -> dict[str, Any]:
        return {
            "kept": now.kept,
            "wanted": now.wanted,
            "running": now.workers,
            "succeeded": now.succeeded,
            "failed": now.failed,
            "steps": round(now.steps_per_second * now.seconds),
            "physics_steps": 0,
            "frames": 0,
            "seconds": now.seconds,
        }

    line = line_of(progress)

    def show(now: ClusterProgress) -> None:
        about = RecordProgress(**counts(now), seconds_left=math.nan)
        if callable(progress):
            progress(about)
        elif line is not None:
            line.show(of_recording(about))

    made = record_on_ray(
        Job(str(own["out"]), options, attempts),
        episodes=own["episodes"],
        max_attempts=own["max_attempts"],
        resume=own["resume"],
        address=address,
        progress=show,
    )
    return RecordSummary(
        **counts(made),
        seconds_left=0.0,
        interrupted=False,
        enough=made.enough,
        failures=made.failures,
        lengths=[],
        times={},
        published_bytes=0,
        path=Path(own["out"]),
    )
