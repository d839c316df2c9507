# SPDX-License-Identifier: Apache-2.0
"""Import of LeRobot v3.0 data sets as recordings."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _libmujoco
from mjsense._arguments import checked
from mjsense._input_files import missing, read_json, read_text
from mjsense._optional import optional
from mjsense.dataset.import_rows import OPTIONS, Rows, archive_of, compile_archive, unique_name
from mjsense.errors import UnknownNameError

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = _libmujoco.shared

_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_RESULTS = ("next.reward", "next.success", "next.done")
_STATE = "observation.state"


@checked
def import_lerobot(
    root: str | Path,
    out: str | Path,
    *,
    episodes: Iterable[int] | None = None,
    scene: str | Path | None = None,
    joints: Sequence[str] | None = None,
    crf: int = 18,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a LeRobot v3.0 data set as a recording, which can be inspected, verified and read, and with ``scene`` replayed and rendered.

    A data set has no simulator states. With ``scene``, the numbers of ``observation.state`` are set as positions of joints of this model,
    and everything else is at its initial position. Row t of the recording has observation t and action t - 1, so the last action of an
    episode, whose result the data set does not contain, is left out. Images are encoded again, as H.264.

    Args:
        root: Folder of the data set.
        out: Folder to write. It must not contain a recording.
        episodes: Indices of episodes; by default all.
        scene: MJCF file of the robot and its surroundings.
        joints: With ``scene``: the joint of each number of ``observation.state``, in order; ``""``: none. By default the names of the
            numbers, which must then be names of joints.
        crf: Quality of the videos, from 0 (lossless) to 51 (worst).
        progress: Called with the number of written episodes and of all episodes.

    Returns:
        ``out``.

    Raises:
        FileNotFoundError: ``root`` is not a data set, or ``scene`` names a file that does not exist.
        ValueError: The data set has another version, or ``joints`` does not fit its state.
        UnknownNameError: The scene has no such joint.
    """
    source = _Source(Path(root))
    wanted = sorted(source.episodes) if episodes is None else [int(i) for i in episodes]
    if wrong := [i for i in wanted if i not in source.episodes]:
        raise ValueError(f"episodes: {wrong[0]} is not in {root}, which has {len(source.episodes)} episodes")
    if joints is not None and scene is None:
        raise ValueError("joints needs scene (--scene), the model that has them")
    pose = None if scene is None else _Pose(Path(scene), source, joints)
    writer = _Writer(out, source, pose, len(wanted), crf)
    for number, index in enumerate(wanted):
        writer.write(number, index)
        if progress is not None:
            progress(number + 1, len(wanted))
    writer.complete()
    return Path(out)


def _needs(module: str) -> Any:
    return optional(module, "export", "import lerobot")


class _Source:
    """The files of a data set."""

    def __init__(self, root: Path) -> None:
        self.root = root
        if not root.exists():
            raise missing(root)
        if not (root / "meta/info.json").exists():
            raise FileNotFoundError(f"{root} is not a LeRobot data set: it has no meta/info.json")
        self.info: dict[str, Any] = read_json(root / "meta/info.json")
        if not isinstance(self.info, dict):
            raise ValueError(f"{root / 'meta/info.json'}: must be a JSON object, not a {type(self.info).__name__}")
        if not str(self.info.get("codebase_version", "")).startswith("v3."):
            raise ValueError(f"{root} has the version {self.info.get('codebase_version')!r}, expected v3.0; "
                             "python -m lerobot.datasets.v30.convert_dataset_v21_to_v30 converts v2.1")  # fmt: skip
        if absent := [key for key in ("features", "fps", "data_path") if key not in self.info]:
            raise ValueError(f"{root / 'meta/info.json'} has no '{absent[0]}'")
        self.features: dict[str, dict[str, Any]] = self.info["features"]
        self.rate = Fraction(self.info["fps"]).limit_denominator(1000)
        self.images = {key: about for key, about in self.features.items() if about["dtype"] in ("video", "image")}
        self.numbers = {key: about for key, about in self.features.items() if key not in (*self.images, *_COUNTERS, *_RESULTS) and about["dtype"] != "string"}
        tables = _needs("pyarrow.parquet")
        self.episodes: dict[int, dict[str, Any]] = {}
        for path in sorted(root.glob("meta/episodes/*/*.parquet")):
            names = tables.read_schema(path).names
            columns = [name for name in names if not name.startswith("stats/")]
            self.episodes |= {row["episode_index"]: row for row in tables.read_table(path, columns=columns).to_pylist()}
        self._tables = tables
        self._read: tuple[str, Any] = "", None

    def rows(self, index: int) -> dict[str, np.ndarray]:
        """Columns of an episode, ``[T, ...]``; images as the bytes of their files."""
        episode = self.episodes[index]
        path = self.info["data_path"].format(chunk_index=episode["data/chunk_index"], file_index=episode["data/file_index"])
        if self._read[0] != path:
            self._read = path, self._tables.read_table(self.root / path)
        table = self._read[1]
        table = table.filter(_needs("pyarrow.compute").equal(table["episode_index"], index))
        found: dict[str, np.ndarray] = {}
        for key in (*self.numbers, *_RESULTS, *(key for key, about in self.images.items() if about["dtype"] == "image")):
            if key in table.column_names:
                values = table[key].to_pylist()
                found[key] = np.array([value["bytes"] for value in values], object) if key in self.images else np.array(values)
        return found

    def shape(self, key: str) -> tuple[int, ...]:
        """Height and width of the images of a camera, or the shape of other values."""
        shape, names = self.features[key]["shape"], self.features[key].get("names") or []
        if key not in self.images:
            return () if list(shape) == [1] else tuple(shape)
        return tuple(shape[1:]) if list(names)[:1] in (["channels"], ["channel"]) else tuple(shape[:2])

    def is_depth(self, key: str) -> bool:
        about = self.features[key]
        info = about.get("info") or about.get("video_info") or {}
        return bool(info.get("is_depth_map") or info.get("video.is_depth_map"))

    def frames(self, index: int, key: str, rows: dict[str, np.ndarray]) -> Iterator[np.ndarray]:
        """Images of an episode: uint8 ``[H, W, 3]``, or depth float32 ``[H, W]``. [m]"""
        av = _needs("av")
        if self.features[key]["dtype"] == "image":
            for content in rows[key]:
                with av.open(io.BytesIO(content)) as file:
                    yield next(file.decode(video=0)).to_ndarray(format="rgb24")
            return
        episode = self.episodes[index]
        place = {name: episode[f"videos/{key}/{name}"] for name in ("chunk_index", "file_index")}
        first, length = episode[f"videos/{key}/from_timestamp"], episode["length"]
        with av.open(str(self.root / self.info["video_path"].format(video_key=key, **place))) as file:
            stream = file.streams.video[0]
            file.seek(int(max(0.0, first) / stream.time_base), stream=stream)
            count = 0
            for frame in file.decode(stream):
                if float(frame.pts * stream.time_base) < first - 0.5 / float(self.rate):
                    continue
                yield self._depth(key, frame.to_ndarray(format="gray12le")) if self.is_depth(key) else frame.to_ndarray(format="rgb24")
                count += 1
                if count == length:
                    return
        raise ValueError(f"{self.root}: the video of {key} has {count} frames of episode {index}, whose length is {length}")

    def _depth(self, key: str, codes: np.ndarray) -> np.ndarray:
        info = self.features[key]["info"]
        near, far, shift = (info[f"video.{name}"] for name in ("depth_min", "depth_max", "shift"))
        part = codes.astype(np.float64) / 4095
        if not info.get("video.use_log", True):
            return (near + part * (far - near)).astype(np.float32)
        return (np.exp(np.log(near + shift) + part * np.log((far + shift) / (near + shift))) - shift).astype(np.float32)


class _Pose:
    """States of a model from the positions of its joints."""

    def __init__(self, scene: Path, source: _Source, joints: Sequence[str] | None) -> None:
        if mujoco is None:
            raise RuntimeError(f"scene needs the series of MuJoCo that mjsense uses: {_libmujoco.explain()}")
        read_text(scene)
        try:
            spec = mujoco.MjSpec.from_file(str(scene))
            spec.compile()
        except ValueError as error:
            raise ValueError(f"scene: MuJoCo cannot load {scene}: {error}") from None

        def read(file: str, folder: str) -> tuple[str, bytes]:
            path = next((path for path in (scene.parent / folder / file, scene.parent / file, Path(file)) if path.is_file()), None)
            if path is None:
                raise FileNotFoundError(f"scene: {scene} names {file}, which does not exist")
            content = path.read_bytes()
            return unique_name(file, content), content

        self.archive = archive_of(spec.to_xml(), read)
        self.model = compile_archive(self.archive[1], str(scene))
        self._data = mujoco.MjData(self.model)
        if _STATE not in source.numbers:
            raise ValueError(f"{source.root} has no {_STATE}, which scene needs")
        about = source.features[_STATE]
        names = joints if joints is not None else about.get("names") or []
        names = [name for part in names.values() for name in part] if isinstance(names, dict) else list(names)
        size = int(np.prod(about["shape"]))
        scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        known = {self.model.joint(i).name: int(self.model.jnt_qposadr[i]) for i in range(self.model.njnt) if self.model.jnt_type[i] in scalar}
        if len(names) != size:
            raise ValueError(f"joints names {len(names)} joints, but {_STATE} has {size} numbers")
        if unknown := [name for name in names if name and name not in known]:
            raise UnknownNameError(f"{scene} has no hinge or slide joint '{unknown[0]}', the name of a number of {_STATE}; joints (--joints) gives others, "
                                   f"of {', '.join(known)}")  # fmt: skip
        self._from = [i for i, name in enumerate(names) if name]
        self._to = [known[names[i]] for i in self._from]

    def state(self, values: np.ndarray, time: float) -> np.ndarray:
        """MuJoCo's state with these numbers of ``observation.state``."""
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION))
        self._data.time = time
        self._data.qpos[self._to] = values.ravel()[self._from]
        mujoco.mj_getState(self.model, self._data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return state


class _Writer:
    def __init__(self, out: str | Path, source: _Source, pose: _Pose | None, episodes: int, crf: int) -> None:
        self._source, self._pose = source, pose
        streams = Rows()
        self._cameras: dict[str, np.ndarray] = {}
        for key in source.images:
            name, shape = key.removeprefix("observation.images.").removeprefix("observation."), source.shape(key)
            if source.is_depth(key):
                name = name if name.endswith("_depth") else f"{name}_depth"
                self._cameras[key] = streams.add(name, "float32", shape, "Depth image of the camera; 0.01 m: no measurement.", video=True, unit="m")
            else:
                self._cameras[key] = streams.add(name, "uint8", (*shape, 3), "Image of the camera.", video=True)
        self._numbers: dict[str, np.ndarray] = {}
        for key, about in source.numbers.items():
            place = "actions/action" if key == "action" else f"observation/{key.removeprefix('observation.')}"
            what = "Action that led to this row; 0 in the first row." if key == "action" else f"Feature {key} of the data set."
            names = about.get("names")
            what += f" Numbers: {', '.join(map(str, names))}." if isinstance(names, list) and len(names) > 1 else ""
            self._numbers[key] = streams.add(place, about["dtype"], source.shape(key), what)
        self._state = None if pose is None else streams.add_state(pose.model)
        settings = {"source": source.root.name, "robot": source.info.get("robot_type") or "", "format": "lerobot"}
        options = {**OPTIONS, "episodes": episodes, "crf": crf} | ({"archive": pose.archive} if pose else {})
        self._recorder = streams.recorder(out, source.rate, settings, options)

    def write(self, number: int, index: int) -> None:
        source, episode = self._source, self._source.episodes[index]
        rows, length = source.rows(index), int(episode["length"])
        frames = {key: source.frames(index, key, rows) for key in self._cameras}
        reward, success, done = (rows.get(key) for key in _RESULTS)
        task = (episode.get("tasks") or [""])[0]
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
            if self._pose is not None and self._state is not None:
                self._state[0] = self._pose.state(rows[_STATE][t], float(t / source.rate))
            before = t - 1  # the results of this step's action
            self._recorder.append(
                [0], [float(reward[before]) if t and reward is not None else 0.0], [bool(t and done is not None and done[before])],
                [t == length - 1], [bool(t and success is not None and success[before])])  # fmt: skip
        outcome = "no success: the data set has no next.success" if success is None else "success" if np.any(success[-1:]) else "no success"
        scene = {"task_description": task, "text": task, "policy_dt_ms": float(1000 / source.rate), "episode_index": index}
        self._recorder.finish_episode(0, json.dumps(scene), outcome)

    def complete(self) -> None:
        self._recorder.complete()
