"""Recording episodes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mjsense import _core
from mjsense._arguments import Seed, checked
from mjsense.assets import use_installed_meshes
from mjsense.sensor import Sensor
from mjsense.simulation import Simulation


@dataclass(frozen=True)
class RecordProgress:
    """How far a recording is."""

    kept: int
    """Episodes on disk."""
    wanted: int
    running: int
    succeeded: int
    """Attempts of this run."""
    failed: int
    steps: int
    """Control steps, all worlds."""
    physics_steps: int
    frames: int
    """Pictures, all cameras."""
    seconds: float
    """Wall time."""
    seconds_left: float
    """NaN until an episode has ended."""


@dataclass(frozen=True)
class RecordSummary(RecordProgress):
    """What a recording has done."""

    interrupted: bool
    enough: bool
    """All wanted episodes are on disk."""
    failures: dict[str, int]
    """Why attempts failed, and how often."""
    lengths: list[int]
    """Observations of each attempt that ended."""
    times: dict[str, float]
    """Wall seconds by room: policy, physics, sensing, rendering, reset, recording."""
    published_bytes: int
    path: Path
    """The folder of the episodes."""


@checked
def record(
    task: str = "pick",
    robot: str = "franka",
    policy: str = "planner",
    *,
    out: str | Path,
    episodes: int = 1,
    worlds: int = 4,
    threads: int = 0,
    seed: Seed = 0,
    cameras: Sequence[str] | None = None,
    width: int | None = None,
    height: int | None = None,
    depth: bool = False,
    samples: int = 1,
    shadows: bool = True,
    horizon: int | None = None,
    action_noise: bool = True,
    sensors: Iterable[Sensor] = (),
    keep_failures: bool = False,
    max_attempts: int = 0,
    resume: bool = False,
    house: int = 0,
    batches: int = 0,
    gzip: int = 4,
    progress: Callable[[RecordProgress], None] | None = None,
) -> RecordSummary:
    """Plays episodes and keeps them as HDF5 and MP4 in ``out/house_<house>/``.

    Which attempts are kept, and every byte of them but the videos' containers, depends on the seed alone: not on the number of
    worlds, on threads, or on an interruption. Ctrl-C keeps what is finished and raises KeyboardInterrupt; call again with
    ``resume=True`` to go on.

    Args:
        task, robot, policy: their registered names, see :func:`task_names` and so on.
        out: folder.
        episodes: how many to keep.
        worlds: played at the same time.
        threads: 0 takes every CPU that this process may use.
        cameras: names of the robot's cameras; all if not given.
        width, height: pixels of every camera; the robot's own if not given.
        depth: record the depth of every camera, losslessly.
        samples: rays per pixel of rgb.
        horizon: control steps after which an attempt has failed.
        sensors: of your own, with an observation_space or is_dict: recorded with the suite.
        keep_failures: also attempts without success.
        max_attempts: 0: six times the episodes.
        resume: go on with what is in the folder; it must have the same settings.
        house: number of the folder below `out`.
        batches: files that the episodes are spread over; 0: one for every four episodes.
        gzip: compression of HDF5, 0 to 9.
        progress: called about ten times a second.
    """
    config = SimpleNamespace(
        task=task, robot=robot, policy=policy, num_worlds=worlds, threads=threads, seed=seed,
        cameras=None if cameras is None else list(cameras), width=width, height=height, depth=depth, samples=samples,
        shadows=shadows, horizon=horizon, action_noise=action_noise, episodes=episodes, max_attempts=max_attempts,
        keep_failures=keep_failures, resume=resume, house=house, batches=batches, gzip=gzip,
    )  # fmt: skip
    own = list(sensors)
    for sensor in own:
        if not isinstance(sensor, Sensor):
            raise TypeError(f"not a mjsense.Sensor: {sensor!r}")
        if sensor._mjs_row_spec() is None:
            raise ValueError(f"sensor '{sensor.uuid}' cannot be recorded: give it an observation_space, or is_dict = True")
    report = None if progress is None else lambda p: progress(RecordProgress(**p))
    use_installed_meshes()
    made = _core.record(config, str(out), report, own, Simulation._of)
    made["path"] = Path(made["path"])
    return RecordSummary(**made)
