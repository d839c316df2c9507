# SPDX-License-Identifier: Apache-2.0
"""Finds out what a word of the user means: a recording, an MJCF, a scene or a task."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mjsense.core.errors import unexpected_keyword
from mjsense.core.later_rooms import provided
from mjsense.dataset import Dataset
from mjsense.dataset.files import INDEX
from mjsense.dataset.remote import is_address
from mjsense.scene.scene import Scene
from mjsense.sensors.configs import SceneCfg
from mjsense.sim.simulation import Simulation
from mjsense.viewer.live import LiveViewer
from mjsense.viewer.recorded import RecordingViewer
from mjsense.viewer.source import LiveSource
from mjsense.viewer.viewer import Viewer

_PERIOD = 1 / 60  # s, about: control step of a model that is viewed alone


def is_recording(path: str | Path) -> bool:
    """Whether this is an existing file or folder of a recording, its index, or the address of one."""
    if is_address(path):
        return True
    path = Path(path)
    return path.is_dir() or path.suffix in (".h5", ".hdf5") or path.name == INDEX


def options_of(given: dict[str, Any]) -> dict[str, Any]:
    """The options that were given."""
    return {name: value for name, value in given.items() if value is not None}


def source_of(thing: Any, *, num_worlds: int = 1, seed: int = 0, **options: Any) -> LiveSource | Dataset:
    """What a viewer can show.

    Args:
        thing: A simulation, an environment, a data set, the path of a recording or an MJCF, or the name, file or object
            of a scene or a task.
        options: Options of :func:`mjsense.make_vec`, for tasks and scenes.
    """
    if "num_envs" in options:
        raise unexpected_keyword("view()", "num_envs", ["num_worlds"])
    if isinstance(thing, (LiveSource, Dataset)):
        return thing
    if hasattr(thing, "warp_model"):
        raise NotImplementedError("mjs.view is not available with backend='warp'; use backend='cpu'")
    if isinstance(thing, Simulation):
        return LiveSource(thing)
    if not isinstance(thing, (str, Path)):
        return provided("task_source")(thing, num_worlds, seed, options)
    if is_address(thing):
        return Dataset(thing)
    if isinstance(thing, Path) or (Path(thing).exists() and thing not in provided("task_names")()):
        path = Path(thing)
        if is_recording(path):
            return Dataset(path)
        if path.suffix in (".xml", ".mjcf"):
            return _model(path, num_worlds, seed)
    return provided("task_source")(thing, num_worlds, seed, options)


def _model(path: Path, worlds: int, seed: int) -> LiveSource:
    if not path.exists():
        raise FileNotFoundError(f"{path} does not exist")
    scene = Scene(SceneCfg(base=path))
    timestep = float(scene.model.opt.timestep)
    source = LiveSource(Simulation(scene, worlds, decimation=max(1, round(_PERIOD / timestep)), seed=seed), path.name)
    source.reset(seed)
    return source


def viewer_of(source: Any, *, world: int, episode: int, seed: int, host: str, port: int) -> Viewer:
    """The viewer of what ``source_of`` has found."""
    if isinstance(source, Dataset):
        return RecordingViewer(source, episode=episode, host=host, port=port)
    return LiveViewer(source, world=world, host=host, port=port, seed=seed)
