# SPDX-License-Identifier: Apache-2.0
"""Export to robomimic's HDF5 files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.env_ids import env_id
from mjsense.dataset import Episode, Video
from mjsense.dataset.model_xml import model_xml
from mjsense.exporting.images import FLAGS, depth_videos
from mjsense.exporting.mapping import Source, check_names, named_streams
from mjsense.exporting.output import needs

_GYM = 2  # robomimic's EnvType.GYM_TYPE
_VALID_EVERY = 10
_OWN = ("actions", "rewards", "dones", "obs", "next_obs", "states", "integration_states", "assets")
"""Members of a demonstration."""


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Writes all episodes to the new file ``path``."""
    _check_names(source)
    with needs("h5py", "robomimic").File(path, "w") as file:
        models: dict[bytes, Any] = {}
        for i, episode in enumerate(source.each(progress)):
            _write_demo(file.create_group(f"data/demo_{i}"), models, source, episode)
        _finish(file, source)


def _check_names(source: Source) -> None:
    observed = [name for name, feature in source.features.items() if not feature.of_step]
    others = [name for name, feature in source.features.items() if feature.of_step and name not in ("action", *FLAGS)]
    check_names(
        [
            *((name, f"robomimic's '{name}'") for name in _OWN),
            *((name, f"the feature '{name}'") for name in others),
            *named_streams(source, observed, "obs/", "_image"),
        ]
    )


def join(source: Source, parts: Iterable[Path], path: Path) -> None:
    """Writes the new file ``path`` with the demonstrations of several files, whose arrays are copied as they are compressed.

    Args:
        source: The episodes of all files.
    """
    h5py = needs("h5py", "robomimic")
    with h5py.File(path, "w") as file:
        models: dict[bytes, Any] = {}
        count = 0
        for part in parts:
            with h5py.File(part) as written:
                for i in range(len(written["data"])):
                    _copy_demo(written[f"data/demo_{i}"], file.create_group(f"data/demo_{count}"), models)
                    count += 1
        _finish(file, source)


def _copy_demo(written: Any, demo: Any, models: dict[bytes, Any]) -> None:
    for name, value in written.attrs.items():
        demo.attrs[name] = value
    for name in written:
        if name != "assets":
            written.copy(name, demo)
    for name, content in written.get("assets", {}).items():
        _write_asset(demo, name, content[()].tobytes(), models)


def _finish(file: Any, source: Source) -> None:
    """Writes what follows the demonstrations."""
    data = file["data"]
    data.attrs["total"] = sum(episode.length - 1 for episode in source.episodes)
    data.attrs["env_args"] = json.dumps(_env_args(source.episodes[0]))
    demos = [f"demo_{i}" for i in range(len(source))]
    masks = {
        "train": [demo for i, demo in enumerate(demos) if i % _VALID_EVERY != _VALID_EVERY - 1],
        "valid": demos[_VALID_EVERY - 1 :: _VALID_EVERY] or demos[-1:],
        "success": [demo for demo, episode in zip(demos, source.episodes) if episode.success],
    }
    if len(demos) > 1 and len(masks["train"]) == len(demos):  # fewer than ten: the last one validates
        masks["train"] = demos[:-1]
    for name, chosen in masks.items():
        file[f"mask/{name}"] = np.array(chosen, "S")


def _env_args(episode: Episode) -> dict[str, Any]:
    """What robomimic creates the environment from: a task and a robot in gymnasium's registry."""
    settings = episode.settings
    task, robot = str(settings.get("task", "")), settings.get("robot")
    return {"env_name": env_id(task, robot) if task else "", "type": _GYM, "env_kwargs": {}, "mjsense": settings}


def _write_demo(demo: Any, models: dict[bytes, Any], source: Source, episode: Episode) -> None:
    """Writes one episode; row t of everything is observation t and the step from it.

    Args:
        models: Files of models, which demonstrations share, by their content.
    """
    steps = episode.length - 1
    demo.attrs["num_samples"] = steps
    about = {"lang": episode.task, "seed": episode.seed, "outcome": episode.outcome, "trimmed_steps": episode.trimmed_steps}
    demo.attrs["ep_meta"] = json.dumps(about)
    rows = source.rows(episode)
    demo["actions"], demo["rewards"] = rows["action"], rows["reward"][:, 0]
    for name, feature in source.features.items():
        if not feature.of_step:
            demo[f"obs/{name}"], demo[f"next_obs/{name}"] = rows[name][:-1], rows[name][1:]
        elif name not in ("action", *FLAGS):
            demo[name] = rows[name]
    dones = rows["terminated"][:, 0] | rows["truncated"][:, 0]
    dones[-1] = True
    demo["dones"] = dones.astype(np.int64)
    for name in source.cameras:
        _write_video(demo, f"{name}_image", source.video(episode, name))
    for name, video in depth_videos(source, episode).items():
        _write_video(demo, f"{name}_depth", video)
    if "replay/state" in episode.streams:
        _write_states(demo, models, episode)


def _write_video(demo: Any, name: str, video: Video) -> None:
    shape = video.shape if len(video.shape) == 4 else (*video.shape, 1)  # robomimic's depth images have one channel
    options = dict(
        dtype=video.dtype, chunks=(1, *shape[1:]), compression="gzip", compression_opts=1, shuffle=video.dtype.itemsize > 1
    )
    steps = len(video) - 1
    now, after = (demo.create_dataset(f"{group}/{name}", (steps, *shape[1:]), **options) for group in ("obs", "next_obs"))
    for t in range(steps + 1):
        frame = video[t].reshape(shape[1:])
        if t < steps:
            now[t] = frame
        if t > 0:
            after[t - 1] = frame


def _write_states(demo: Any, models: dict[bytes, Any], episode: Episode) -> None:
    """``states`` as robosuite's ``MjSimState.flatten``: time, qpos, qvel. ``integration_states`` is all that MuJoCo's state
    contains."""
    model = episode.model()
    states = episode.states[:-1]
    numbers = 1 + model.nq + model.nv  # mjSTATE_INTEGRATION begins with time, qpos, qvel
    demo["states"] = states[:, :numbers]
    demo.create_dataset("integration_states", data=states, compression="gzip", compression_opts=4)
    demo.attrs["model_file"], assets = model_xml(episode)
    for name, content in assets.items():
        _write_asset(demo, name, content, models)


def _write_asset(demo: Any, name: str, content: bytes, models: dict[bytes, Any]) -> None:
    if content not in models:
        models[content] = demo.create_dataset(f"assets/{name}", data=np.frombuffer(content, np.uint8))
    else:
        demo[f"assets/{name}"] = models[content]  # a link
