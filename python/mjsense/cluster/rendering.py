# SPDX-License-Identifier: Apache-2.0
"""Rendering of recordings on Ray."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.cluster.driver import ClusterProgress, ClusterSummary, run_job
from mjsense.cluster.job import Shard
from mjsense.cluster.tasks import check_pickle
from mjsense.core.counted import counted
from mjsense.core.old_names import old_argument
from mjsense.dataset import Dataset, render
from mjsense.dataset.remote import absolute

_CHUNK = 16  # episodes of one task


@dataclass(frozen=True)
class _Rendering:
    """A rendering as a job: its shards are ranges of the chosen episodes."""

    root: str
    out: str
    positions: tuple[int, ...]
    arguments: dict[str, Any] = field(default_factory=dict)

    def settings(self) -> dict[str, Any]:
        values = {"version": _core.__version__, "root": self.root, "episodes": self.positions, "options": self.arguments}  # pyright: ignore[reportAttributeAccessIssue]
        return json.loads(json.dumps(values, default=_text))

    def fingerprint(self) -> str:
        return hashlib.sha256(json.dumps(self.settings(), sort_keys=True).encode()).hexdigest()[:16]

    def about(self, shard: Shard) -> str:
        chosen = self.positions[shard.first : shard.first + shard.count]
        return f"episodes {chosen[0]} to {chosen[-1]}"

    def record(self, folder: Path, shard: Shard) -> dict[str, Any]:
        chosen = self.positions[shard.first : shard.first + shard.count]
        render(self.root, folder, episodes=chosen, **{"threads": 1, **self.arguments, "progress": False})
        episodes = Dataset(folder).episodes
        succeeded = sum(episode.success for episode in episodes)
        return {
            "succeeded": succeeded,
            "failed": len(episodes) - succeeded,
            "steps": sum(e.length for e in episodes),
            "failures": {},
        }


def _text(value: Any) -> str:
    """What decides an argument, without addresses of objects."""
    if isinstance(value, partial):
        return f"{_text(value.func)}{value.args}"
    return getattr(value, "__qualname__", None) or str(value)


@old_argument("worlds", "num_worlds")
def render_on_ray(
    root: str | Path,
    out: str | Path,
    *,
    episodes: Sequence[int] | None = None,
    shard_episodes: int = _CHUNK,
    address: str = "local",
    resume: bool = False,
    runtime_env: dict[str, Any] | None = None,
    progress: Callable[[ClusterProgress], None] | None = None,
    **options: Any,
) -> ClusterSummary:
    """Renders recorded episodes as :func:`mjsense.render` does, on Ray. The result has shards and an index, as a recording on
    Ray.

    Args:
        root: A recording that all workers see: a path, an index, or an address.
        out: Output directory, or an address.
        episodes: Positions of episodes in the recording; by default all.
        shard_episodes: Number of episodes of one task.
        address: ``local`` for a cluster of this machine's CPUs, ``auto``, or the address of a cluster.
        resume: Continue an interrupted rendering with the same arguments.
        runtime_env: Ray's runtime environment.
        progress: Called about once per second.
        options: Further arguments of :func:`mjsense.render`. Sensors must be a function that makes them.
    """
    if wrong := [name for name in options if name in ("batches", "resume", "progress")]:
        raise ValueError(f"render_on_ray: '{wrong[0]}' is not an option of a rendering on Ray")
    check_pickle("render", options)
    count = len(Dataset(root).episodes)
    positions = tuple(range(count)) if episodes is None else tuple(episodes)
    if invalid := [i for i in positions if not 0 <= i < count]:
        raise ValueError(f"episodes: {invalid[0]} is not in {root}, which has {counted(count, 'episode')}")
    job = _Rendering(absolute(root), absolute(out), positions, options)
    shards = [
        Shard(n, first, min(shard_episodes, len(positions) - first))
        for n, first in enumerate(range(0, len(positions), shard_episodes))
    ]
    return run_job(job, shards, len(positions), {"shard_episodes": shard_episodes}, address, resume, runtime_env, progress)
