# SPDX-License-Identifier: Apache-2.0
"""The files of a LeRobot v3.0 data set that another program has written."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from mjsense.core.counted import counted
from mjsense.core.input_files import missing
from mjsense.core.optional import optional
from mjsense.dataset import bounded_json, parquet_footer
from mjsense.dataset import foreign_values as foreign
from mjsense.dataset.lerobot_features import Feature
from mjsense.dataset.png_sizes import image_size, text_size

STATE = "observation.state"
RESULTS = ("next.reward", "next.success", "next.done")
_COUNTERS = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_MAX_VALUES, _MAX_TABLE = 1 << 27, 1 << 30  # numbers and bytes of one Parquet file; LeRobot writes files of 100 MB
_CODECS = ("av1", "libdav1d", "libaom-av1", "h264", "hevc", "vp9", "libvpx-vp9", "ffv1")
_MAX_IMAGE_TEXT = 1 << 28  # bytes of unpacked texts, which FFmpeg does not limit
_MAX_FIXED = 16  # bytes of a value of a type of fixed length, such as float16


def _needs(module: str) -> Any:
    return optional(module, "export", "import lerobot")


class LeRobotReader:
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
            if key not in (*self.images, *_COUNTERS, *RESULTS) and one.dtype != "string"
        }
        self._tables = _needs("pyarrow.parquet")
        self.episodes: dict[int, dict[str, Any]] = {}
        for path in sorted(root.glob("meta/episodes/*/*.parquet")):
            for row in self._table(path, lambda name: not name.startswith("stats/")).to_pylist():
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

    def _table(self, path: Path, wanted: Callable[[str], bool] = lambda _: True) -> Any:
        """The wanted columns of a Parquet file."""
        place = foreign.regular_inside((self.root,), path, str(path))
        try:
            with foreign.open_file(place, str(path)) as plain:
                texts = self._checked_texts(path, plain)
                return self._rows(path, plain, texts, wanted)
        except Exception as error:  # pyarrow's errors have no common base class
            raise self._damaged(path, error) from None

    def _checked_texts(self, path: Path, plain: Any) -> list[str]:
        """The columns of texts, after the sizes of all columns have been checked."""
        footer = parquet_footer.read(path, plain)
        if footer.rows > foreign.MAX_ROWS or footer.values > _MAX_VALUES or footer.bytes > _MAX_TABLE:
            raise ValueError(
                f"{path}: has {counted(footer.rows, 'row')}, {counted(footer.values, 'value')} and {footer.bytes} bytes, "
                f"the limits are {foreign.MAX_ROWS}, {_MAX_VALUES} and {_MAX_TABLE}"
            )
        schema = self._opened(plain).schema
        columns = [schema.column(i) for i in range(len(schema))]
        if long := [column.path for column in columns if column.length > _MAX_FIXED]:
            raise ValueError(f"{path}: the column {foreign.found(long[0])} has values of more than {_MAX_FIXED} bytes")
        return [column.path for column in columns if column.physical_type == "BYTE_ARRAY"]

    def _rows(self, path: Path, plain: Any, texts: list[str], wanted: Callable[[str], bool]) -> Any:
        """The wanted columns. A text is stored once, however many rows have it, so the bytes of all rows are counted before rows
        are made of them."""
        file = self._opened(plain, read_dictionary=texts)
        names, parts, size = [name for name in file.schema_arrow.names if wanted(name)], [], 0
        for group in range(file.num_row_groups):  # each has dictionaries of its own
            parts.append(file.read_row_group(group, names))
            size += sum(_bytes_of(part) for column in parts[-1].columns for part in column.chunks)
            if size > _MAX_TABLE:
                raise ValueError(f"{path}: its rows have more than {_MAX_TABLE} bytes, which is the limit")
        return _needs("pyarrow").concat_tables(parts) if parts else file.schema_arrow.empty_table().select(names)

    def _opened(self, plain: Any, **options: Any) -> Any:
        return self._tables.ParquetFile(_needs("pyarrow").PythonFile(plain, "r"), **options)

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
            *RESULTS,
            *(key for key, one in self.images.items() if one.dtype == "image"),
            "episode_index",
            "task_index",
        ]
        if self._read[0] != path:
            self._read = path, self._table(path, wanted.__contains__)
        table = self._read[1]
        kind = table.schema.field("episode_index").type if "episode_index" in table.column_names else None
        if kind is None or not _needs("pyarrow").types.is_integer(kind):
            raise ValueError(f"{path}: has no column episode_index of whole numbers")
        table = table.filter(_needs("pyarrow.compute").equal(table["episode_index"], index))
        length = episode["length"]
        if table.num_rows != length:
            raise ValueError(f"{path}: has {counted(table.num_rows, 'row')} of episode {index}, whose length is {length}")
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
            elif key in self.features and key not in RESULTS:
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
        table = self._table(path).to_pydict()
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
            with (
                foreign.open_file(path, str(path)) as content,
                av.open(content, format=_container(content, path), options={"protocol_whitelist": "none"}) as file,
            ):
                stream = next(iter(file.streams.video), None)
                if stream is None or stream.codec_context is None or stream.codec_context.name not in _CODECS:
                    raise ValueError(f"{path}: has no video of a codec of LeRobot: AV1, H.264, HEVC, VP9 or FFV1")
                feature.check_size(stream.codec_context.height, stream.codec_context.width, str(path))
                file.seek(int(max(0.0, first) / stream.time_base), stream=stream)
                for frame in file.decode(stream):
                    if frame.pts is None:
                        raise ValueError(f"{path}: has a frame without a time")
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
        raise ValueError(
            f"{self.root}: the video of {key} has {counted(count, 'frame')} of episode {index}, whose length is {length}"
        )


def _bytes_of(array: Any) -> int:
    """Bytes of all values of a column's part, of which texts have dictionaries."""
    arrow, compute = _needs("pyarrow"), _needs("pyarrow.compute")
    kind = array.type
    if arrow.types.is_dictionary(kind):
        return compute.sum(compute.take(compute.binary_length(array.dictionary), array.indices)).as_py() or 0
    if arrow.types.is_struct(kind):
        return sum(_bytes_of(array.field(i)) for i in range(kind.num_fields))
    return _bytes_of(array.values) if hasattr(array, "values") else array.nbytes


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
        raise ValueError(f"{place}: row {t} is {foreign.found(value)}, expected {counted(size, 'number')} of the type {dtype}")
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
        if (size := text_size(content)) > _MAX_IMAGE_TEXT:
            raise ValueError(f"{place}: its texts may unpack to {size} bytes, the limit is {_MAX_IMAGE_TEXT}")
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
