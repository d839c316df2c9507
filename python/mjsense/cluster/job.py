# SPDX-License-Identifier: Apache-2.0
"""A recording that can be divided into shards, and the work of one shard."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.cluster.scratch import scratch_folder
from mjsense.cluster.storage import Storage
from mjsense.dataset import Episode, bounded_json, index
from mjsense.dataset.episode_rows import Store
from mjsense.dataset.files import entries_of
from mjsense.dataset.limits import SCENE_BYTES
from mjsense.tasks.parts import parts_of
from mjsense.tasks.record_job import PARTS, check_names, record_here

_OF_RECORD = {"sensors", "progress", "format", "map", "trim_idle", "keep_recording", "ray"}
"""Arguments of ``record`` that do not decide the data."""
_FREE = _OF_RECORD | set(
    """
    num_worlds worlds threads episodes max_attempts attempts first_attempt num_attempts shard resume append overwrite ffmpeg
    batches out
    """.split()
)
"""Arguments of ``record`` that do not change the episodes, or that the driver sets."""


@dataclass(frozen=True)
class Shard:
    """The attempts ``first`` to ``first + count - 1`` of a job; of a job with a list of attempts, those at these positions."""

    number: int
    first: int
    count: int

    @property
    def folder(self) -> str:
        """Name of its folder in the output directory."""
        return f"shard_{self.number}"


@dataclass
class ShardResult:
    """What a shard recorded; ``done.json`` in its folder."""

    shard: Shard
    fingerprint: str
    """Of the job; results of another job are refused."""
    episodes: list[dict[str, Any]]
    """One dict for each kept episode: episode (its attempt), path (relative to the shard), trajectory, seed, length, success,
    outcome, task."""
    succeeded: int
    failed: int
    steps: int
    """Steps of the policy."""
    failures: dict[str, int] = field(default_factory=dict)
    """Number of failed attempts by reason."""
    seconds: float = 0.0
    """Wall-clock time of the worker."""

    @staticmethod
    def parse(text: bytes) -> ShardResult:
        """Inverse of ``json.dumps(asdict(result))``.

        Raises:
            ValueError: The text is damaged, or was changed by someone: a value has another type, or a path leaves the shard.
        """
        values = bounded_json.parse_object(text, "done.json", SCENE_BYTES)
        kinds = {
            "shard": dict,
            "fingerprint": str,
            "episodes": list,
            "succeeded": int,
            "failed": int,
            "steps": int,
            "failures": dict,
            "seconds": (int, float),
        }
        for name, value in values.items():
            if not isinstance(value, kinds.get(name, ())):
                raise ValueError(f"done.json: {name} is {bounded_json.kind_of(value)}, which is never written")
        shard, rows = values.get("shard", {}), values.get("episodes", [])
        if set(shard) != {"number", "first", "count"} or not all(isinstance(n, int) and 0 <= n < 2**53 for n in shard.values()):
            raise ValueError("done.json: shard must have a number, the first attempt and the count")
        if not all(isinstance(count, int) for count in values.get("failures", {}).values()):
            raise ValueError("done.json: failures must be numbers of attempts by their reason")
        checked = [index.checked_row("done.json", i, row) for i, row in enumerate(rows)]
        if missing := kinds.keys() - values.keys() - {"failures", "seconds"}:
            raise ValueError(f"done.json has no {min(missing)}")
        return ShardResult(**{**values, "shard": Shard(**shard), "episodes": checked})


@dataclass(frozen=True)
class Job:
    """What the workers record. It is sent to them by pickle."""

    out: str
    """Output directory: a path, or a URL of a file system that fsspec knows, such as ``s3://bucket/data``."""
    arguments: dict[str, Any]
    """Keyword arguments of :func:`mjsense.record`."""
    attempts: tuple[int, ...] = ()
    """Numbers of the attempts, in ascending order, instead of those from 0 on."""

    def settings(self) -> dict[str, Any]:
        """Everything that decides which episodes the job contains, as JSON values."""
        sensors = self.arguments.get("sensors", ())
        options = {**PARTS, **self.arguments, "resume": True}  # the code of all parts must be comparable
        check_names(options.keys() - _OF_RECORD)
        code = parts_of(options, sensors)[4]
        decided = {name: value for name, value in options.items() if name not in _FREE}
        found = {"version": _core.__version__, "options": decided, "code": code}  # pyright: ignore[reportAttributeAccessIssue]
        if self.attempts:
            found["attempts"] = self.attempts
        return json.loads(json.dumps(found, default=str))

    def fingerprint(self) -> str:
        """Checksum of the settings."""
        return hashlib.sha256(json.dumps(self.settings(), sort_keys=True).encode()).hexdigest()[:16]

    def about(self, shard: Shard) -> str:
        """What the shard contains, for messages."""
        played = self.attempts[shard.first :][: shard.count] or (shard.first, shard.first + shard.count - 1)
        return f"attempts {played[0]} to {played[-1]}"

    def record(self, folder: Path, shard: Shard) -> dict[str, Any]:
        """Records the shard's attempts into an empty local folder. Returns the summary as ``mjsense record --json`` prints it."""
        options = {name: value for name, value in self.arguments.items() if name not in _OF_RECORD}
        played: dict[str, Any] = {"first_attempt": shard.first, "num_attempts": shard.count}
        if self.attempts:
            played = {"attempts": self.attempts[shard.first :][: shard.count]}
        options = {"threads": 1, **options, "out": folder, **played}
        summary = record_here(options, self.arguments.get("sensors", ()), progress=False)
        return {name: getattr(summary, name) for name in ("succeeded", "failed", "steps", "failures")}


def _kept_episodes(folder: Path) -> Iterable[dict[str, Any]]:
    if not any(folder.glob("house_*/trajectories_batch_*.h5")):
        return
    entries, recordings = entries_of(folder)
    store = Store(recordings, 0)
    for e in (Episode(entry, i, store) for i, entry in enumerate(entries)):
        yield {
            "episode": e.number,
            "path": str(e.path.relative_to(folder)),
            "trajectory": e.trajectory,
            "seed": e.seed,
            "length": e.length,
            "success": e.success,
            "outcome": e.outcome,
            "task": e.task,
        }


def run_shard(job: Job, shard: Shard, fingerprint: str) -> ShardResult:
    """Records a shard into a temporary folder, moves it to the output directory, and marks it as done."""
    began = time.perf_counter()
    with scratch_folder() as folder:
        summary = job.record(folder, shard)
        result = ShardResult(
            shard,
            fingerprint,
            list(_kept_episodes(folder)),
            summary["succeeded"],
            summary["failed"],
            summary["steps"],
            summary["failures"],
            time.perf_counter() - began,
        )
        storage = Storage(job.out)
        storage.put_folder(folder, shard.folder)
        storage.write(f"{shard.folder}/done.json", json.dumps(asdict(result)).encode())
        return result
