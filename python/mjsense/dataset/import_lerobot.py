# SPDX-License-Identifier: Apache-2.0
"""Import of LeRobot v3.0 data sets as recordings."""

from __future__ import annotations

import io
import json
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from mjsense.core import libmujoco
from mjsense.core.arguments import checked
from mjsense.core.declared_fields import given_options
from mjsense.core.errors import UnknownNameError
from mjsense.core.input_files import missing, read_text
from mjsense.core.new_output import new_output
from mjsense.core.optional import optional
from mjsense.dataset import bounded_json, parquet_footer
from mjsense.dataset import foreign_values as foreign
from mjsense.dataset.import_rows import NOT_A_NUMBER, Rows, archive_of, compile_archive, unique_name
from mjsense.dataset.model_fields import MAX_STATE
from mjsense.dataset.model_sizes import image_size

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = libmujoco.shared

_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_RESULTS = ("next.reward", "next.success", "next.done")
_STATE = "observation.state"
_TYPES = ("float16", "float32", "float64", "bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64")
_BLOCK = 16  # pixels
_MAX_VALUES, _MAX_TABLE = 1 << 27, 1 << 30  # numbers and bytes of one Parquet file; LeRobot writes files of 100 MB


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
    source = _Source(Path(root))
    wanted = sorted(source.episodes) if episodes is None else [int(i) for i in episodes]
    if wrong := [i for i in wanted if i not in source.episodes]:
        raise ValueError(f"episodes: {wrong[0]} is not in {root}, which has {len(source.episodes)} episodes")
    if joints is not None and scene is None:
        raise ValueError("joints needs scene (--scene), the model that has them")
    wanted = _with_rows(source, wanted)
    pose = None if scene is None else _Pose(Path(scene), source, joints)
    with new_output(out) as part:
        writer = _Writer(part, source, pose, wanted, files)
        for number, index in enumerate(wanted):
            writer.write(number, index)
            if progress is not None:
                progress(number + 1, len(wanted))
        writer.complete()
    return Path(out)


def _with_rows(source: _Source, wanted: list[int]) -> list[int]:
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


def _needs(module: str) -> Any:
    return optional(module, "export", "import lerobot")


class _Source:
    """The files of a data set. Everything that they state is checked here."""

    def __init__(self, root: Path) -> None:
        self.root = root
        if not root.exists():
            raise missing(root)
        if not (root / "meta/info.json").exists():
            raise FileNotFoundError(f"{root} is not a LeRobot data set: it has no meta/info.json")
        place = str(root / "meta/info.json")
        content = foreign.read_bytes(foreign.file_inside(root, "meta/info.json", place), place, foreign.MAX_JSON)
        self.info = bounded_json.parse_object(content, place, foreign.MAX_JSON)
        if not str(self.info.get("codebase_version", "")).startswith("v3."):
            raise ValueError(
                f"{root} has the version {foreign.found(self.info.get('codebase_version'))}, expected v3.0; "
                "python -m lerobot.datasets.v30.convert_dataset_v21_to_v30 converts v2.1"
            )
        if absent := [key for key in ("features", "fps", "data_path") if key not in self.info]:
            raise ValueError(f"{place} has no '{absent[0]}'")
        self.robot = foreign.text(self.info.get("robot_type") or "", f"{place}: robot_type")
        features = foreign.mapping(self.info["features"], f"{place}: features")
        self.features = {key: Feature(key, about, f"{place}: features: {foreign.found(key)}") for key, about in features.items()}
        self.rate = foreign.rate(self.info["fps"], f"{place}: fps")
        self.images = {key: one for key, one in self.features.items() if one.is_image}
        self.numbers = {
            key: one
            for key, one in self.features.items()
            if key not in (*self.images, *_COUNTERS, *_RESULTS) and one.dtype != "string"
        }
        self._tables = _needs("pyarrow.parquet")
        self.episodes: dict[int, dict[str, Any]] = {}
        for path in sorted(root.glob("meta/episodes/*/*.parquet")):
            names = self._names(path)
            for row in self._table(path, [name for name in names if not name.startswith("stats/")]).to_pylist():
                index = foreign.whole(row.get("episode_index"), f"{path}: episode_index", 0, 2**31)
                if index in self.episodes:
                    raise ValueError(f"{path}: episode_index {index} is there twice")
                foreign.whole(row.get("length"), f"{path}: length of episode {index}", 0, foreign.MAX_ROWS)
                tasks = row.get("tasks")
                if tasks is not None and not (
                    isinstance(tasks, list) and all(isinstance(task, str) and len(task) <= 10_000 for task in tasks)
                ):
                    raise ValueError(f"{path}: tasks of episode {index} is {foreign.found(tasks)}, expected a list of texts")
                self.episodes[index] = row
        if not self.episodes:
            raise ValueError(f"{root}/meta/episodes contains no episodes (chunk-000/file-000.parquet ...)")
        self._read: tuple[Path, Any] = Path(), None

    def _names(self, path: Path) -> list[str]:
        try:
            return self._tables.read_schema(foreign.regular_inside((self.root,), path, str(path))).names
        except Exception as error:  # pyarrow's errors have no common base class
            raise self._damaged(path, error) from None

    def _table(self, path: Path, columns: list[str]) -> Any:
        """Columns of a Parquet file."""
        place = foreign.regular_inside((self.root,), path, str(path))
        try:
            with open(place, "rb") as plain:
                footer = parquet_footer.read(path, plain)
            if footer.rows > foreign.MAX_ROWS or footer.values > _MAX_VALUES or footer.bytes > _MAX_TABLE:
                raise ValueError(
                    f"{path}: has {footer.rows} rows, {footer.values} values and {footer.bytes} bytes, "
                    f"the limits are {foreign.MAX_ROWS}, {_MAX_VALUES} and {_MAX_TABLE}"
                )
            return self._tables.read_table(place, columns=columns)
        except Exception as error:
            raise self._damaged(path, error) from None

    def _damaged(self, path: Path, error: Exception) -> Exception:
        if isinstance(error, OSError) and not path.exists():
            return missing(path)
        text = " ".join(str(error).split())
        return ValueError(text if text.startswith(str(path)) else f"{path}: cannot be read: {text[:300]}")

    def _path(self, key: str, index: int, **values: Any) -> Path:
        """A file of an episode, by its template in info.json."""
        place = f"{self.root / 'meta/info.json'}: {key}"
        template = foreign.text(self.info.get(key), place, 1000)
        for name, value in values.items():
            if name != "video_key":
                values[name] = foreign.whole(value, f"{self.root / 'meta/episodes'}: {name} of episode {index}", 0, 10**6)

        def fill(match: re.Match[str]) -> str:
            value = values.get(match[1])
            if value is None:
                raise ValueError(f"{place}: is {foreign.found(template)}, expected only the fields {', '.join(values)}")
            return f"{value:0{match[2]}d}" if match[2] else str(value)

        name = re.sub(r"\{(\w+)(?::0?(\d)d)?\}", fill, template)
        if "{" in name or "}" in name:
            raise ValueError(f"{place}: is {foreign.found(template)}, expected fields such as {{chunk_index:03d}}")
        return foreign.file_inside(self.root, name, place)

    def rows(self, index: int) -> dict[str, np.ndarray]:
        """Columns of an episode, ``[T, ...]``; images as the bytes of their files; ``task``: positions in its list of tasks."""
        episode = self.episodes[index]
        path = self._path(
            "data_path", index, chunk_index=episode.get("data/chunk_index"), file_index=episode.get("data/file_index")
        )
        wanted = [
            *self.numbers,
            *_RESULTS,
            *(key for key, one in self.images.items() if one.dtype == "image"),
            "episode_index",
            "task_index",
        ]
        if self._read[0] != path:
            known = self._names(path)
            self._read = path, self._table(path, [name for name in wanted if name in known])
        table = self._read[1]
        if "episode_index" not in table.column_names:
            raise ValueError(f"{path}: has no column episode_index")
        table = table.filter(_needs("pyarrow.compute").equal(table["episode_index"], index))
        length = episode["length"]
        if table.num_rows != length:
            raise ValueError(f"{path}: has {table.num_rows} rows of episode {index}, whose length is {length}")
        found: dict[str, np.ndarray] = {}
        for key in wanted[:-2]:
            if key in table.column_names:
                values = table[key].to_pylist()
                place = f"{path}: episode {index}: {key}"
                if key not in self.features:
                    found[key] = _numbers(values, "float64", (), place)
                elif key in self.images:
                    found[key] = np.array([_file_of(value, place) for value in values], object)
                else:
                    one = self.features[key]
                    found[key] = _numbers(values, one.dtype if key in self.numbers else "float64", one.shape, place)
            elif key in self.features and key not in _RESULTS:
                raise ValueError(f"{path}: has no column {key}, which info.json states")
        if "task_index" in table.column_names:
            found["task"] = self._positions_of_tasks(table["task_index"].to_pylist(), episode, f"{path}: episode {index}")
        return found

    def _positions_of_tasks(self, numbers: list[Any], episode: dict[str, Any], place: str) -> np.ndarray:
        """For each row the position of its task in the episode's list."""
        tasks = episode.get("tasks") or []
        if len(tasks) < 2:
            return np.zeros(len(numbers), np.int64)
        path = self.root / "meta/tasks.parquet"
        if not path.exists():
            raise ValueError(f"{place} has {len(tasks)} tasks, and {path} is missing")
        table = self._table(path, self._names(path)).to_pydict()
        texts = next((values for key, values in table.items() if key in ("task", "__index_level_0__")), None)
        if texts is None or "task_index" not in table:
            raise ValueError(f"{path}: has the columns {', '.join(table)}, expected task and task_index")
        text_of = dict(zip(table["task_index"], texts))
        positions = [tasks.index(text_of[number]) if text_of.get(number) in tasks else -1 for number in numbers]
        if -1 in positions:
            number = numbers[positions.index(-1)]
            raise ValueError(
                f"{place}: task_index is {foreign.found(number)}, expected that of a task of the episode: {foreign.found(tasks)}"
            )
        return np.array(positions, np.int64)

    def frames(self, index: int, key: str, rows: dict[str, np.ndarray]) -> Iterator[np.ndarray]:
        """Images of an episode: uint8 ``[H, W, 3]``, or depth float32 ``[H, W]``. [m]"""
        feature = self.features[key]
        if feature.dtype == "image":
            for t, content in enumerate(rows[key]):
                yield _image(content, feature, f"{self.root}: image {t} of {key} in episode {index}")
            return
        episode = self.episodes[index]
        places = {name: episode.get(f"videos/{key}/{name}") for name in ("chunk_index", "file_index")}
        path = self._path("video_path", index, video_key=foreign.plain_name(key, f"{self.root}: features"), **places)
        first = foreign.number(
            episode.get(f"videos/{key}/from_timestamp"), f"{self.root}: from_timestamp of {key} in episode {index}", -1, 1e7
        )
        length, count = episode["length"], 0
        av = _needs("av")
        try:
            with path.open("rb") as content, av.open(content, format=_container(content, path)) as file:
                if not file.streams.video or file.streams.video[0].codec_context is None:
                    raise ValueError(f"{path}: has no video")
                stream = file.streams.video[0]
                feature.check_size(stream.codec_context.height, stream.codec_context.width, str(path))
                file.seek(int(max(0.0, first) / stream.time_base), stream=stream)
                for frame in file.decode(stream):
                    if float(frame.pts * stream.time_base) < first - 0.5 / float(self.rate):
                        continue
                    feature.check_size(frame.height, frame.width, str(path))
                    yield (
                        feature.depth(frame.to_ndarray(format="gray12le"))
                        if feature.is_depth
                        else frame.to_ndarray(format="rgb24")
                    )
                    count += 1
                    if count == length:
                        return
        except av.error.FFmpegError as error:
            raise ValueError(f"{path}: cannot be decoded: {' '.join(str(error).split())}") from None
        raise ValueError(f"{self.root}: the video of {key} has {count} frames of episode {index}, whose length is {length}")


class Feature:
    """One entry of ``features``."""

    def __init__(self, key: str, about: Any, place: str) -> None:
        about = foreign.mapping(about, place)
        foreign.text(key, place, 200)
        self.dtype = foreign.text(about.get("dtype"), f"{place}: dtype", 40)
        if self.dtype not in (*_TYPES, "video", "image", "string"):
            raise ValueError(
                f"{place}: dtype is {foreign.found(self.dtype)}, expected one of {', '.join(_TYPES)}, video, image, string"
            )
        self.is_image = self.dtype in ("video", "image")
        shape = about.get("shape")
        if not isinstance(shape, list) or not 1 <= len(shape) <= 8:
            raise ValueError(f"{place}: shape is {foreign.found(shape)}, expected a list of whole numbers")
        sizes = [foreign.whole(size, f"{place}: shape", 1, 10**6) for size in shape]
        if (count := math.prod(sizes)) > foreign.MAX_ROW_NUMBERS and not self.is_image:
            raise ValueError(f"{place}: shape has {count} numbers, the limit is {foreign.MAX_ROW_NUMBERS}")
        names = about.get("names")
        names = (
            [name for part in names.values() for name in (part if isinstance(part, list) else [part])]
            if isinstance(names, dict)
            else names
        )
        if names is not None and not (isinstance(names, list) and all(isinstance(name, (str, int)) for name in names)):
            raise ValueError(f"{place}: names is {foreign.found(names)}, expected a list of texts")
        self.names = [str(name)[:200] for name in names or []]
        info = foreign.mapping(about.get("info") or about.get("video_info") or {}, f"{place}: info")
        self.is_depth = bool(info.get("is_depth_map") or info.get("video.is_depth_map"))
        self._info, self._place = info, place
        self.shape: tuple[int, ...] = self._image_shape(sizes) if self.is_image else () if sizes == [1] else tuple(sizes)
        """Height and width of images, or the shape of other values."""
        if self.is_depth:
            self._depth = [
                foreign.number(info.get(f"video.{name}"), f"{place}: video.{name}", 0, 1e6)
                for name in ("depth_min", "depth_max", "shift")
            ]
            if not self._depth[0] + self._depth[2] > 0 or not self._depth[0] < self._depth[1]:
                raise ValueError(
                    f"{place}: depths from {self._depth[0]} to {self._depth[1]} m with a shift of {self._depth[2]} "
                    "m, expected rising values above 0"
                )

    def _image_shape(self, sizes: list[int]) -> tuple[int, int]:
        """Height and width, wherever the channels are: by their name, or else by their number."""
        if len(sizes) not in (2, 3):
            raise ValueError(f"{self._place}: shape is {sizes}, expected height, width and channels")
        if len(sizes) == 2:
            return foreign.image_shape(sizes[0], sizes[1], f"{self._place}: shape")
        named = (
            [i for i, name in enumerate(self.names[:3]) if name.lower() in ("channel", "channels", "c")]
            if len(self.names) == 3
            else []
        )
        last = named[0] == 2 if named else sizes[2] in (1, 3, 4)
        if sizes[2 if last else 0] not in (1, 3, 4):
            raise ValueError(
                f"{self._place}: shape is {sizes} with the names {self.names}, expected 1, 3 or 4 channels at its start or end"
            )
        height, width = sizes[:2] if last else sizes[1:]
        return foreign.image_shape(height, width, f"{self._place}: shape")

    def check_size(self, height: int, width: int, place: str) -> None:
        """Encoders may add rows and columns, up to their block size."""
        if not (0 <= height - self.shape[0] < _BLOCK and 0 <= width - self.shape[1] < _BLOCK):
            raise ValueError(
                f"{place}: has images of {height} x {width} pixels, and info.json states {self.shape[0]} x {self.shape[1]}"
            )

    def depth(self, codes: np.ndarray) -> np.ndarray:
        near, far, shift = self._depth
        part = codes.astype(np.float64) / 4095
        if not self._info.get("video.use_log", True):
            return (near + part * (far - near)).astype(np.float32)
        return (np.exp(np.log(near + shift) + part * np.log((far + shift) / (near + shift))) - shift).astype(np.float32)


def _numbers(values: list[Any], dtype: str, shape: tuple[int, ...], place: str) -> np.ndarray:
    """Rows of this shape. Single numbers may be lists of one."""
    try:
        array = np.array(values, dtype)
        return array.reshape(len(values), *shape)
    except (TypeError, ValueError, OverflowError):
        pass
    size = math.prod(shape)
    for t, value in enumerate(values):
        try:
            if np.array(value, dtype).size == size:
                continue
        except (TypeError, ValueError, OverflowError):
            pass
        raise ValueError(f"{place}: row {t} is {foreign.found(value)}, expected {size} numbers of the type {dtype}")
    raise ValueError(f"{place}: the rows are not arrays of {[*shape]} numbers of the type {dtype}")


def _file_of(value: Any, place: str) -> bytes:
    content = value.get("bytes") if isinstance(value, dict) else None
    if not isinstance(content, bytes):
        raise ValueError(f"{place}: is {foreign.found(value)}, expected the bytes of a PNG or JPEG file")
    return content


def _image(content: bytes, feature: Feature, place: str) -> np.ndarray:
    av = _needs("av")
    kind = "png_pipe" if content.startswith(b"\x89PNG") else "jpeg_pipe" if content.startswith(b"\xff\xd8") else None
    if kind is None:
        raise ValueError(f"{place}: is neither a PNG nor a JPEG file")
    if kind == "png_pipe":
        width, height = image_size(content)
        feature.check_size(height, width, place)
    try:
        with av.open(io.BytesIO(content), format=kind) as file:
            if file.streams.video[0].codec_context is None:
                raise ValueError(f"{place}: has no image")
            feature.check_size(file.streams.video[0].codec_context.height, file.streams.video[0].codec_context.width, place)
            return next(file.decode(video=0)).to_ndarray(format="rgb24")
    except (av.error.FFmpegError, StopIteration) as error:
        raise ValueError(f"{place}: cannot be decoded: {' '.join(str(error).split())}") from None


def _container(file: IO[bytes], path: Path) -> str:
    """FFmpeg's name of the format. It must not choose one by itself: a playlist names other files and addresses."""
    start = file.read(12)
    file.seek(0)
    if start[4:8] == b"ftyp":
        return "mp4"
    if start[:4] == b"\x1a\x45\xdf\xa3":
        return "matroska"
    raise ValueError(f"{path}: is neither an MP4 nor a Matroska file")


class _Pose:
    """States of a model from the positions of its joints."""

    def __init__(self, scene: Path, source: _Source, joints: Sequence[str] | None) -> None:
        if mujoco is None:
            raise RuntimeError(f"scene needs the series of MuJoCo that mjsense uses: {libmujoco.explain()}")
        read_text(scene)
        try:
            spec = mujoco.MjSpec.from_file(str(scene))
            spec.compile()
        except ValueError as error:
            raise ValueError(f"scene: MuJoCo cannot load {scene}: {error}") from None

        def read(file: str, folder: str) -> tuple[str, bytes]:
            path = next(
                (path for path in (scene.parent / folder / file, scene.parent / file, Path(file)) if path.is_file()), None
            )
            if path is None:
                raise FileNotFoundError(f"scene: {scene} names {file}, which does not exist")
            content = path.read_bytes()
            return unique_name(file, content), content

        self.archive = archive_of(spec.to_xml(), read, str(scene))
        self.model = compile_archive(self.archive[1], str(scene))
        self._data = mujoco.MjData(self.model)
        if _STATE not in source.numbers:
            raise ValueError(f"{source.root} has no {_STATE}, which scene needs")
        feature = source.features[_STATE]
        names = list(joints) if joints is not None else feature.names
        size = math.prod(feature.shape)
        scalar = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))
        known = {
            self.model.joint(i).name: int(self.model.jnt_qposadr[i])
            for i in range(self.model.njnt)
            if self.model.jnt_type[i] in scalar
        }
        if len(names) != size:
            raise ValueError(f"joints names {len(names)} joints, but {_STATE} has {size} numbers")
        if unknown := [name for name in names if name and name not in known]:
            raise UnknownNameError(
                f"{scene} has no hinge or slide joint '{unknown[0]}', the name of a number of {_STATE}; joints "
                "(--joints) gives others, "
                f"of {', '.join(known)}"
            )
        self._from = [i for i, name in enumerate(names) if name]
        self._to = [known[names[i]] for i in self._from]

    def state(self, values: np.ndarray, time: float, about: str) -> np.ndarray:
        """MuJoCo's state with these numbers of ``observation.state``."""
        if not np.all(np.abs(values) <= MAX_STATE):
            raise ValueError(f"{about}: {_STATE} is {foreign.found(values.tolist())}, expected numbers of at most {MAX_STATE:g}")
        state = np.empty(mujoco.mj_stateSize(self.model, mujoco.mjtState.mjSTATE_INTEGRATION))
        self._data.time = time
        self._data.qpos[self._to] = values.ravel()[self._from]
        mujoco.mj_getState(self.model, self._data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
        return state


class _Writer:
    def __init__(
        self, out: str | Path, source: _Source, pose: _Pose | None, episodes: Sequence[int], files: dict[str, Any]
    ) -> None:
        self._source, self._pose = source, pose
        streams = Rows()
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
        reward, success, done = (rows.get(key) for key in _RESULTS)
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
                    rows[_STATE][t], float(t / source.rate), f"{source.root}: episode {index}, row {t}"
                )
            before = t - 1  # the results of this step's action
            self._recorder.append(
                [0],
                [float(reward[before]) if t and reward is not None else 0.0],
                [bool(t and done is not None and done[before])],
                [t == length - 1],
                [bool(t and success is not None and success[before])],
            )
        outcome = (
            "no success: the data set has no next.success"
            if success is None
            else "success"
            if np.any(success[-1:])
            else "no success"
        )
        task = ", then ".join(tasks)
        scene = {"task_description": task, "text": task, "policy_dt_ms": float(1000 / source.rate), "episode_index": index}
        self._recorder.finish_episode(0, json.dumps(scene | ({"tasks": tasks} if len(tasks) > 1 else {})), outcome)

    def complete(self) -> None:
        self._recorder.complete()
