# SPDX-License-Identifier: Apache-2.0
"""Finds out what a word of the user means: a recording, an MJCF, a scene or a task."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mjsense._core import robot_names
from mjsense.core.errors import UnknownNameError
from mjsense.dataset import Dataset
from mjsense.dataset.files import INDEX
from mjsense.dataset.remote import is_address
from mjsense.scene.scene import Scene
from mjsense.sensors.configs import SceneCfg, SceneFileCfg
from mjsense.sim.simulation import Simulation
from mjsense.tasks.env import TaskEnv
from mjsense.tasks.task import task_names
from mjsense.tasks.vector import TaskVectorEnv, make_vec
from mjsense.viewer.live import LiveViewer
from mjsense.viewer.recorded import RecordingViewer
from mjsense.viewer.source import LiveSource, TaskSource
from mjsense.viewer.viewer import Viewer

_IMAGE = {"width": 320, "height": 240, "depth": True, "segmentation": True}
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


def source_of(thing: Any, *, worlds: int = 1, seed: int = 0, **options: Any) -> LiveSource | Dataset:
    """What a viewer can show.

    Args:
        thing: A simulation, an environment, a data set, the path of a recording or an MJCF, or the name, file or object
            of a scene or a task.
        options: Options of :func:`mjsense.make_vec`, for tasks and scenes.
    """
    if isinstance(thing, (LiveSource, Dataset)):
        return thing
    if isinstance(thing, Simulation):
        return LiveSource(thing)
    if hasattr(thing, "warp_model"):
        raise NotImplementedError("mjs.view is not available with backend='warp'; use backend='cpu'")
    if isinstance(thing, TaskEnv):
        thing = thing.worlds
    if isinstance(thing, TaskVectorEnv):
        return TaskSource(thing)
    if isinstance(thing, (str, Path)) and is_address(thing):
        return Dataset(thing)
    if isinstance(thing, Path) or (isinstance(thing, str) and Path(thing).exists() and thing not in task_names()):
        path = Path(thing)
        if is_recording(path):
            return Dataset(path)
        if path.suffix in (".xml", ".mjcf"):
            return _model(path, worlds, seed)
    options = {"policy": "planner", "render_mode": "rgb_array", "num_envs": worlds, "seed": seed, **_IMAGE, **options}
    if not isinstance(thing, (str, Path, SceneFileCfg)):
        return TaskSource(make_vec(thing, **options), type(thing).__name__)
    if isinstance(thing, str) and thing in task_names():
        return TaskSource(make_vec(thing, **options), thing)
    if thing in robot_names():
        raise ValueError(f"'{thing}' is a robot: name a task, and the robot as an option (--robot {thing}, robot='{thing}')")
    title = thing.name if isinstance(thing, SceneFileCfg) else str(thing)
    try:
        return TaskSource(make_vec(options.pop("task", "pick"), scene=thing, **options), title)
    except UnknownNameError as error:
        raise UnknownNameError(
            f"'{thing}' is neither a file nor the name of a task ({', '.join(task_names())}) or scene: {error}"
        ) from None


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
