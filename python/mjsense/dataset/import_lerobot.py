# SPDX-License-Identifier: Apache-2.0
"""Import of LeRobot v3.0 data sets as recordings."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.declared_fields import given_options
from mjsense.core.new_output import new_output
from mjsense.dataset import foreign_values as foreign
from mjsense.dataset.import_rows import NOT_A_NUMBER, Rows
from mjsense.dataset.joint_poses import JointPoses
from mjsense.dataset.lerobot_reader import RESULTS, STATE, LeRobotReader


@checked
def import_lerobot(
    root: str | Path,
    out: str | Path,
    *,
    episodes: Iterable[int] | None = None,
    scene: str | Path | None = None,
    joints: Sequence[str] | None = None,
    # options of a recording
    batches: int = 0,
    gzip: int = 4,
    ffmpeg: str = "",
    crf: int = 18,
    preset: str = "veryfast",
    tune: str = "fastdecode",
    keyint: int = 20,
    # end of options
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a LeRobot v3.0 data set as a recording, which can be inspected, verified and read, and with ``scene`` replayed and
    rendered.

    A data set has no simulator states. With ``scene``, the numbers of ``observation.state`` are set as positions of joints of
    this model, and everything else is at its initial position. Row t of the recording has observation t and action t - 1, so the
    last action of an episode, whose result the data set does not contain, is left out, as are episodes without rows, with a
    warning. Images are encoded again, as H.264. If an episode has several tasks, ``observation/task`` has the position of each
    row's task in the list ``tasks`` of ``obs_scene``.

    Args:
        root: Folder of the data set.
        out: Folder to write. It must not exist, or be empty; after an error it is not written.
        episodes: Indices of episodes; by default all.
        scene: MJCF file of the robot and its surroundings.
        joints: With ``scene``: the joint of each number of ``observation.state``, in order; ``""``: none. By default the names of
            the numbers, which must then be names of joints.

        Options:
        batches: Number of HDF5 files over which the episodes are distributed; 0: one per four episodes.
        gzip: Compression level of arrays, 0 to 9.
        ffmpeg: Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.
        crf: Quality of the videos, from 0 (lossless) to 51 (worst).
        preset: Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats.
        tune: Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and files are a
            seventh larger.
        keyint: Maximum number of frames between key frames. A small value makes random access faster, a large value
            makes files smaller.
        Others:
        progress: Called with the number of written episodes and of all episodes.

    Returns:
        ``out``.

    Raises:
        FileNotFoundError: ``root`` is not a data set, or ``scene`` names a file that does not exist.
        ValueError: The data set has another version, or ``joints`` does not fit its state.
        UnknownNameError: The scene has no such joint.
    """
    files = given_options("FilesCfg", locals())
    source = LeRobotReader(Path(root))
    wanted = sorted(source.episodes) if episodes is None else [int(i) for i in episodes]
    if wrong := [i for i in wanted if i not in source.episodes]:
        raise ValueError(f"episodes: {wrong[0]} is not in {root}, which has {counted(len(source.episodes), 'episode')}")
    if joints is not None and scene is None:
        raise ValueError("joints needs scene (--scene), the model that has them")
    wanted = _with_rows(source, wanted)
    pose = None if scene is None else JointPoses(Path(scene), source, joints)
    with new_output(out) as part:
        writer = _Writer(part, source, pose, wanted, files)
        for number, index in enumerate(wanted):
            writer.write(number, index)
            if progress is not None:
                progress(number + 1, len(wanted))
        writer.complete()
    return Path(out)


def _with_rows(source: LeRobotReader, wanted: list[int]) -> list[int]:
    empty = [index for index in wanted if source.episodes[index]["length"] == 0]
    if len(empty) == len(wanted):
        raise ValueError(f"{source.root}: no episode has rows")
    if empty:
        warnings.warn(
            f"{source.root}: {len(empty)} of {len(wanted)} episodes have no rows and are left out: {empty[:10]}", stacklevel=4
        )
    if short := [index for index in wanted if source.episodes[index]["length"] == 1]:
        warnings.warn(
            f"{source.root}: {len(short)} of {len(wanted)} episodes have one row, whose action is left out: {short[:10]}",
            stacklevel=4,
        )
    return [index for index in wanted if index not in set(empty)]


class _Writer:
    def __init__(
        self, out: str | Path, source: LeRobotReader, pose: JointPoses | None, episodes: Sequence[int], files: dict[str, Any]
    ) -> None:
        self._source, self._pose = source, pose
        streams = Rows(str(source.root))
        self._cameras: dict[str, np.ndarray] = {}
        names: dict[str, str] = {}
        for key, feature in source.images.items():
            name = foreign.plain_name(
                key.removeprefix("observation.images.").removeprefix("observation."),
                f"{source.root}: features: {foreign.found(key)}",
            )
            name = f"{name}_depth" if feature.is_depth and not name.endswith("_depth") else name
            if name in names:
                raise ValueError(f"{source.root}: the features {names[name]} and {key} are the same camera '{name}'")
            names[name] = key
            if feature.is_depth:
                self._cameras[key] = streams.add(
                    name, "float32", feature.shape, "Depth image of the camera; 0.01 m: no measurement.", video=True, unit="m"
                )
            else:
                self._cameras[key] = streams.add(name, "uint8", (*feature.shape, 3), "Image of the camera.", video=True)
        self._numbers: dict[str, np.ndarray] = {}
        for key, feature in source.numbers.items():
            name = key.removeprefix("observation.")
            place = (
                "actions/action"
                if key == "action"
                else f"observation/{foreign.plain_name(name, f'{source.root}: features: {foreign.found(key)}')}"
            )
            if place in names:
                raise ValueError(f"{source.root}: the features {names[place]} and {key} are the same stream '{place}'")
            names[place] = key
            what = "Action that led to this row; 0 in the first row." if key == "action" else f"Feature {key} of the data set."
            what += f" Numbers: {', '.join(feature.names)}." if len(feature.names) > 1 else ""
            what += NOT_A_NUMBER if feature.dtype.startswith("float") else ""
            self._numbers[key] = streams.add(
                place, "float32" if feature.dtype == "float16" else feature.dtype, feature.shape, what
            )
        self._task = None
        if any(len(source.episodes[i].get("tasks") or []) > 1 for i in episodes):
            what = "Task of this row: its position in the list 'tasks' of obs_scene, from 0."
            self._task = streams.add("observation/task", "int64", (), what)
        self._state = None if pose is None else streams.add_state(pose.model)
        settings = {"source": source.root.name, "robot": source.robot, "format": "lerobot"}
        options = {**files, "episodes": len(episodes)} | ({"archive": pose.archive} if pose else {})
        self._recorder = streams.recorder(out, source.rate, settings, options)

    def write(self, number: int, index: int) -> None:
        source, episode = self._source, self._source.episodes[index]
        rows, length = source.rows(index), int(episode["length"])
        frames = {key: source.frames(index, key, rows) for key in self._cameras}
        reward, success, done = (rows.get(key) for key in RESULTS)
        if reward is not None and not np.isfinite(reward).all():
            raise ValueError(f"{source.root}: next.reward of episode {index} is not finite, expected numbers")
        tasks = episode.get("tasks") or [""]
        self._recorder.begin_episode(0, number, 0)
        for t in range(length):
            for key, row in self._cameras.items():
                image = next(frames[key])
                row[0] = image[: row.shape[1], : row.shape[2]]
            for key, row in self._numbers.items():
                if key == "action":
                    row[0] = rows[key][t - 1].reshape(row[0].shape) if t else 0
                else:
                    row[0] = rows[key][t].reshape(row[0].shape)
            if self._task is not None:
                self._task[0] = rows["task"][t] if "task" in rows else 0
            if self._pose is not None and self._state is not None:
                self._state[0] = self._pose.state(
                    rows[STATE][t], float(t / source.rate), f"{source.root}: episode {index}, row {t}"
                )
            before = t - 1  # the results of this step's action
            self._recorder.append(
                [0],
                [float(reward[before]) if t and reward is not None else 0.0],
                [bool(t and done is not None and done[before])],
                [t == length - 1],
                [bool(t and success is not None and success[before])],
            )
        if success is None:
            outcome = "no success: the data set has no next.success"
        else:
            outcome = "success" if np.any(success[-1:]) else "no success"
        task = ", then ".join(tasks)
        scene = {"task_description": task, "text": task, "policy_dt_ms": float(1000 / source.rate), "episode_index": index}
        self._recorder.finish_episode(0, json.dumps(scene | ({"tasks": tasks} if len(tasks) > 1 else {})), outcome)

    def complete(self) -> None:
        self._recorder.complete()
