# SPDX-License-Identifier: Apache-2.0
"""The rows of one episode of a recording: its attributes, arrays and videos."""

from __future__ import annotations

import copy
import warnings
from collections.abc import Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core import representations
from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.dataset import bounded_json, json_rows
from mjsense.dataset.cache import Cache
from mjsense.dataset.description import Description, image_size, rate_of
from mjsense.dataset.files import EpisodeEntry
from mjsense.dataset.hdf5 import Group, open_h5
from mjsense.dataset.hdf5_rows import Rows
from mjsense.dataset.hdf5_values import text_of
from mjsense.dataset.limits import NAME_BYTES, PERIOD_MS, SCENE_BYTES
from mjsense.dataset.places import plain_name, printable
from mjsense.dataset.streams import (
    LARGE_ROW,
    NUMBERS,
    REPLAY,
    VIDEOS,
    Stream,
    check_known,
    dataset_of,
    given_name,
    is_json,
    is_mask,
    unit_of,
)
from mjsense.dataset.video import FrameReader, Video, VideoInfo

_ENCODINGS = ("rgb", "depth16", "molmospaces_red_green")


def _own(values: np.ndarray) -> np.ndarray:
    """A copy, of lists in it too: those of the cache stay as they are."""
    return copy.deepcopy(values) if values.dtype == object else values.copy()


def _video_name(camera: str) -> str:
    return camera if camera.startswith(VIDEOS) else VIDEOS + camera


class Store:
    """What all episodes of a data set share: the recordings' descriptions and the caches."""

    def __init__(self, recordings: list[Description], cache_bytes: int) -> None:
        self.recordings = recordings
        self.rows = Cache(cache_bytes // 2)
        self.frames = FrameReader(Cache(cache_bytes // 2), self.rows)
        self.models = Cache(4)  # one unit per model
        self.known: dict[int, dict[str, Stream | None]] = {}
        """Arrays of each recording by their places in a trajectory; None: no stream."""
        self.videos: dict[tuple[int, str], str] = {}
        """Encoding and size of each video of a recording."""
        self.compared: set[tuple[int, str]] = set()
        """Streams with large rows of which the checksum was compared, by the index of their episode."""
        self.leaves: set[str] | None = None
        """Leaves of JSON rows that the data set knows; others cause a warning. None: no warning."""


@partial(checked, owner="Episode")
class EpisodeRows:
    """The recorded attributes, arrays and videos of an episode. :class:`Episode` adds replay and quality."""

    def __init__(self, entry: EpisodeEntry, index: int, store: Store, kept: Sequence[int] | None = None) -> None:
        self._entry, self._store = entry, store
        self._kept = None if kept is None else np.asarray(kept)  # rows of the recording; None: all
        self.index = index
        """Position in the whole recording, whatever the filters of the data set are."""

    @property
    def path(self) -> Path:
        """The HDF5 file."""
        return self._entry.path

    @property
    def trajectory(self) -> str:
        """Name of the group in the file: ``traj_0``."""
        return self._entry.trajectory

    @property
    def house(self) -> int | None:
        """Number of the ``house_N`` folder."""
        return self._entry.house

    @property
    def number(self) -> int:
        """Number of the attempt when it was recorded."""
        return self._entry.number

    @property
    def seed(self) -> int | None:
        """Seed of the recording; None if the file has none."""
        return self._entry.seed

    @property
    def length(self) -> int:
        """Number of observations: one after the reset and one after each step; of a trimmed episode those that are left."""
        return self._entry.length if self._kept is None else len(self._kept)

    @property
    def trimmed_steps(self) -> int:
        """Number of steps that :meth:`Episode.trimmed` left out; 0 of a complete episode."""
        return self._entry.length - self.length

    @property
    def outcome(self) -> str:
        """``success``, or why the episode failed."""
        return self._entry.outcome

    @property
    def success(self) -> bool:
        """Whether the outcome is ``success``."""
        return self.outcome == "success"

    @property
    def settings(self) -> dict[str, Any]:
        """The recording's settings: task, robot, policy, seed and so on. Empty for files that MolmoSpaces wrote."""
        return copy.deepcopy(self._recording.all_settings)

    @property
    def obs_scene(self) -> dict[str, Any]:
        """Task, description, objects, cameras and phases of the episode."""
        return copy.deepcopy(self._scene)

    @property
    def task(self) -> str:
        """The instruction."""
        scene = self._scene
        return str(scene.get("instruction") or scene.get("text") or scene.get("task_description") or "")

    @property
    def fps(self) -> Fraction:
        """Observations per second, exactly."""
        if self._recording.fps is not None:
            return self._recording.fps
        period = self._scene.get("policy_dt_ms")
        if not isinstance(period, (int, float)) or not 1e-3 <= period <= PERIOD_MS:
            raise ValueError(f"{self.path} does not state its rate: no attribute 'recording' and no policy_dt_ms in obs_scene")
        return Fraction(1000) / Fraction(period).limit_denominator(1000)

    @property
    def streams(self) -> dict[str, Stream]:
        """All streams by name. JSON rows appear as one stream per leaf: ``obs/agent/qpos/arm``."""
        return dict(self._streams)

    def __len__(self) -> int:
        return self.length

    def __repr__(self) -> str:
        return f"Episode({self.index}, {self.task!r}, {counted(self.length, 'observation')}, {printable(self.outcome)!r})"

    def _repr_html_(self) -> str:
        """HTML for notebooks: the episode's attributes, and images of its start, middle and end."""
        facts = [
            ("outcome", self.outcome),
            ("observations", f"{self.length}, {float(self.length / self.fps):.2f} s"),
            ("seed", self.seed),
            ("file", f"{self.path}, {self.trajectory}"),
        ]
        return representations.block(f"episode {self.index}: {self.task}", representations.grid(("", ""), facts) + self._film())

    def _film(self) -> str:
        """Images of each camera at the start, the middle and the end, as HTML; empty where videos cannot be read."""
        strips = []
        for name in (name for name, stream in self.streams.items() if stream.kind == "video"):
            video = self.video(name)
            try:
                images = {
                    f"{name.removeprefix(VIDEOS)}, step {t}": video[t].reshape(*video.shape[1:3], -1)
                    for t in (0, self.length // 2, self.length - 1)
                }
            except (OSError, RuntimeError):
                continue
            strips.append(f"<div>{representations.figures(images)}</div>")
        return "".join(strips)

    def __contains__(self, name: str) -> bool:
        return name in self._streams or any(stream.startswith(f"{name}/") for stream in self._streams)

    def __getitem__(self, name: str) -> Any:
        """All rows of a stream; of a group (``actions/joint_pos``, ``env_states/actors``) a dict of its streams."""
        if name.startswith(VIDEOS):
            return self.video(name)[:]
        if found := self._load([name]):
            return _own(found[name])
        inside = [stream for stream in self._streams if stream.startswith(f"{name}/")]
        if not inside:
            raise self._unknown(name)
        if any(self.streams[stream].kind == "video" for stream in inside):
            raise KeyError(f"'{name}' is the group of the videos; name one of {', '.join(inside)}")
        return {stream[len(name) + 1 :]: _own(values) for stream, values in self._load(inside).items()}

    def video(self, camera: str) -> Video:
        """Frames of a camera (``wrist_camera``, ``wrist_camera_depth``), decoded when they are indexed."""
        return Video(self._video(camera), self._store.frames, None if self._kept is None else self._kept.tolist())

    def image_histogram(self, camera: str) -> np.ndarray | None:
        """int64 [3, 256]: how often each level of red, green and blue occurs in all images of a camera, counted before they were
        encoded.

        Of each image every n-th row and column counts, from the first on, with the smallest n with which the longer side has at
        most 160. None for depth, a trimmed episode, and recordings of earlier versions and of MolmoSpaces.
        """
        if self.video(camera).trimmed:
            return None
        with open_h5(self.path) as file:
            counts = file[self.trajectory][_video_name(camera)].attrs.get("histogram")
        if counts is not None and np.shape(counts) != (3, 256):
            raise ValueError(
                f"{self.path} {self.trajectory}: the histogram of '{camera}' has the shape {list(np.shape(counts))}, not [3, 256]"
            )
        return None if counts is None else counts.astype(np.int64)

    # The next functions are for this package.

    def _video(self, camera: str) -> VideoInfo:
        videos = self._store.rows.get((self.index, "videos"), self._find_videos)
        info = videos.get(_video_name(camera))
        if info is None:
            cameras = ", ".join(name[len(VIDEOS) :] for name in videos)
            raise UnknownNameError(
                f"Episode {self.index} ({self.path.name}, {self.trajectory}) has no video '{camera}'; it has "
                f"{cameras or 'no videos'}"
            )
        return info

    def _frames(self, cameras: list[str], rows: list[list[int]]) -> list[list[np.ndarray]]:
        """Images of each camera at its rows of the recording."""
        return self._store.frames.frames([(self._video(camera), at) for camera, at in zip(cameras, rows)])

    @property
    def _recording(self) -> Description:
        return self._store.recordings[self._entry.recording]

    @property
    def _scene(self) -> dict[str, Any]:
        return self._store.rows.get((self.index, "scene"), self._read_scene)

    @property
    def _streams(self) -> dict[str, Stream]:
        return self._store.rows.get((self.index, "streams"), self._find_streams)

    def _read_scene(self) -> tuple[dict[str, Any], int]:
        with open_h5(self.path) as file:
            dataset = file[self.trajectory].get("obs_scene")
            text = "{}" if dataset is None else dataset.text()
        scene = bounded_json.parse_object(text, f"{self.path} {self.trajectory}/obs_scene", SCENE_BYTES)
        if isinstance(scene.get("objects", {}), (bool, int, float, str, type(None))):
            raise ValueError(
                f"{self.path} {self.trajectory}/obs_scene: objects is {bounded_json.kind_of(scene['objects'])}; it "
                "must be an object"
            )
        return scene, 16 * len(text)

    def _unknown(self, name: str) -> UnknownNameError:
        known = [*self.streams, *{stream.rsplit("/", 1)[0] for stream in self.streams}]
        return UnknownNameError(
            f"Episode {self.index} ({self.path.name}, {self.trajectory}) has no stream '{name}'{did_you_mean(name, known)}"
        )

    def _find_videos(self) -> tuple[dict[str, VideoInfo], int]:
        videos: dict[str, VideoInfo] = {}
        with open_h5(self.path) as file:
            for key, dataset in file[self.trajectory].get(VIDEOS.rstrip("/"), {}).items():
                if isinstance(dataset, Group) or dataset.dtype != np.uint8 or dataset.ndim != 1 or len(dataset) > 4 * NAME_BYTES:
                    raise ValueError(f"{dataset.where} must be the bytes of a file name")
                name, at = text_of(dataset[0 : len(dataset)].tobytes()), dataset.attrs  # its checksum is that of the video
                if not name or "width" not in at:
                    continue
                plain_name(name, f"{dataset.where}: its video")
                width, height = image_size(at.integer("width", 1, 2**31), at.integer("height", 1, 2**31), dataset.where)
                if (encoding := at.text("encoding")) not in _ENCODINGS:
                    raise ValueError(
                        f"{dataset.where}: its encoding is '{printable(encoding[:50])}'; it must be one of "
                        f"{', '.join(_ENCODINGS)}"
                    )
                rate = rate_of(at.text("fps"), f"{dataset.where}: fps")
                if (stated := self._recording.fps) is not None and rate != stated:
                    raise ValueError(f"{dataset.where}: fps is {rate}; that of its recording is {stated}")
                about = f"{encoding} {width} x {height}"
                if (first := self._store.videos.setdefault((self._entry.recording, key), about)) != about:
                    raise ValueError(f"{dataset.where} is {about}; in another episode of the recording it is {first}")
                videos[VIDEOS + key] = VideoInfo(
                    self.path.parent / name,
                    self._entry.length,
                    width,
                    height,
                    encoding,
                    at.number("metres_per_unit", 0.0),
                    rate,
                    at.text("crc32"),
                )
        return videos, 500 * len(videos)

    def _find_streams(self) -> tuple[dict[str, Stream], int]:
        streams: dict[str, Stream] = {}
        videos = self._store.rows.get((self.index, "videos"), self._find_videos)
        # Opening a dataset takes most of the time. Arrays have the same type and attributes in all episodes of a recording.
        known = self._store.known.setdefault(self._entry.recording, {})
        with open_h5(self.path) as file:
            trajectory = file[self.trajectory]
            for place in trajectory.datasets():
                if place not in known:
                    streams |= {stream.name: stream for stream in self._streams_at(place, trajectory, videos, known)}
                elif (stream := known[place]) is not None:
                    streams[stream.name] = stream
        return dict(sorted(streams.items())), 500 * len(streams)

    def _streams_at(
        self, place: str, trajectory: Group, videos: dict[str, VideoInfo], known: dict[str, Stream | None]
    ) -> list[Stream]:
        """The streams of a dataset; adds to ``known`` what it is in all episodes of the recording, unless they can differ."""
        read_elsewhere = place in ("obs_scene", REPLAY + "held") or place.startswith(REPLAY + "model/")
        dataset = None if read_elsewhere else trajectory[place]
        if dataset is None or isinstance(dataset, Group) or not (dataset.is_number and dataset.shape):
            known[place] = None  # nothing that a stream can be
            return []
        about = {key: dataset.attrs.text(key) for key in ("unit", "frame", "description")}
        name = place.removeprefix(NUMBERS)
        check_known(name, dataset)
        if name.startswith(VIDEOS):
            if (info := videos.get(name)) is None:
                return []
            return [Stream(name, np.dtype(np.uint8 if info.encoding == "rgb" else np.float32), info.shape, **about, kind="video")]
        if is_json(dataset):
            if NUMBERS + name in trajectory:
                known[place] = None
                return []
            return self._json_streams(name, dataset, about)
        if is_mask(name) and dataset.dtype != bool:
            raise ValueError(f"{dataset.where} is {dataset.dtype}; it must be bool, whether each action is given")
        known[place] = stream = Stream(name, dataset.dtype, dataset.shape[1:], **about)
        return [stream]

    def _json_streams(self, name: str, dataset: Rows, about: dict[str, str]) -> list[Stream]:
        """A stream for each leaf of a dataset of JSON rows, and one for its mask if it has one."""
        streams = []
        for leaf, values in self._decode(name, dataset).items():
            unit = unit_of(about["unit"], leaf[len(name) + 1 :])
            streams.append(Stream(leaf, values.dtype, values.shape[1:], **about | {"unit": unit}, kind="json"))
            if mask := given_name(leaf):
                streams.append(Stream(mask, np.dtype(bool), (), "", "", f"Whether {leaf} is given; if not, it is 0.", "json"))
        return streams

    def _decode(self, place: str, dataset: Any) -> dict[str, np.ndarray]:
        """Arrays of the leaves of a dataset of JSON rows; they and their masks are cached."""
        result: dict[str, np.ndarray] = {}
        for path, (values, given) in json_rows.decode(dataset.rows_of(self._entry.length).read(), dataset.where).items():
            leaf = place + path
            result[leaf] = values
            self._store.rows.add((self.index, leaf), values, values.nbytes)
            if mask := given_name(leaf):
                self._store.rows.add((self.index, mask), given, given.nbytes)
        if self._store.leaves is not None and (new := result.keys() - self._store.leaves):
            self._store.leaves |= new
            warnings.warn(
                f"Episode {self.index} ({self.path}) has {', '.join(sorted(new))}, which the first, the last and "
                "other examined episodes "
                "lack; samples leave it out unless streams= names it",
                stacklevel=2,
            )
        return result

    def _load(self, names: list[str]) -> dict[str, np.ndarray]:
        """Whole arrays of streams that are not videos. Streams that this episode does not have are left out."""
        found = self._load_recorded(names)
        return found if self._kept is None else {name: rows[self._kept] for name, rows in found.items()}

    def _load_recorded(self, names: list[str]) -> dict[str, np.ndarray]:
        """As :meth:`_load`, with all rows of the recording."""
        cache, found = self._store.rows, {}
        for name in names:
            if (values := cache.find((self.index, name))) is not None:
                found[name] = values
        missing = [name for name in names if name not in found]
        if not missing:
            return found
        decoded: set[str] = set()
        with open_h5(self.path) as file:
            trajectory = file[self.trajectory]
            for name in missing:
                if (there := dataset_of(trajectory, name)) is None:
                    continue
                place, dataset = there
                if is_json(dataset):
                    if place not in decoded:
                        decoded.add(place)
                        found.update(self._decode(place, dataset))
                    if (values := cache.find((self.index, name))) is not None:
                        found[name] = values
                elif place.removeprefix(NUMBERS) == name:
                    found[name] = self._checked(place, dataset).read()
                    if found[name].nbytes < LARGE_ROW * max(1, self._entry.length):
                        cache.add((self.index, name), found[name], found[name].nbytes)
        return {name: found[name] for name in names if name in found}

    def _checked(self, place: str, dataset: Rows) -> Rows:
        """The dataset of a stream, if it has a row for each observation, and the type and shape that it has in other episodes of
        the recording."""
        check_known(place, dataset)
        stream = self._store.known.get(self._entry.recording, {}).get(place)
        if stream is not None and (dataset.dtype, dataset.shape[1:]) != (stream.dtype, stream.shape):
            raise ValueError(
                f"{dataset.where} is {dataset.dtype} {list(dataset.shape[1:])}; in another episode of the recording "
                f"it is {stream.dtype} {list(stream.shape)}"
            )
        return dataset.rows_of(self._entry.length)

    def _large_rows(self, name: str, rows: list[int]) -> np.ndarray:
        """Rows of the recording, of a stream whose rows are too large to keep all of them."""
        with open_h5(self.path) as file:
            trajectory = file[self.trajectory]
            place = NUMBERS + name if NUMBERS + name in trajectory else name
            dataset = self._checked(place, trajectory[place])
            if not dataset.has_chunk_checksums and (self.index, name) not in self._store.compared:
                dataset.compare()
                self._store.compared.add((self.index, name))
            return np.stack([dataset[t] for t in rows])
