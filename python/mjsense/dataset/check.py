# SPDX-License-Identifier: Apache-2.0
"""What the readers of recordings refuse, for ``mjsense verify``: a recording without findings is read by every command.

The C++ library compares checksums and examines the structure of the files. This module opens each episode with the readers that
all Python commands use, so that neither accepts what the other refuses.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace
from pathlib import Path

from mjsense.core import libmujoco
from mjsense.dataset import playback
from mjsense.dataset.episode import Episode
from mjsense.dataset.episode_rows import Store
from mjsense.dataset.files import batches, entries_of
from mjsense.dataset.hdf5 import Group, open_h5
from mjsense.dataset.json_rows import decode
from mjsense.dataset.render_cameras import check_frames, recorded_cameras
from mjsense.dataset.streams import NUMBERS, REPLAY, VIDEOS, is_json
from mjsense.dataset.video_decoder import Packets, have_av

_REFUSALS = (ValueError, LookupError, OSError, RuntimeError)
_CACHE_BYTES = 1 << 26
_OPTIONAL = ("replay/model/", "replay/held", "replay/changed")  # only in episodes that need them
_NAME_BYTES = 100  # of the name of a video, padded with 0


def findings(root: Path, skip: Collection[str] = ()) -> Iterator[tuple[str, str]]:
    """What readers refuse: ``("house_0/trajectories_batch_1_of_2.h5 traj_3", "why")``.

    Args:
        root: Folder or file of a recording.
        skip: Names of files, relative to the root, that are known to be damaged. They are not opened: the HDF5 library may crash.
    """
    try:
        files = batches(root)
    except FileNotFoundError:  # nothing is published yet
        return
    except _REFUSALS as error:
        yield str(root), _without(root, error)
        return
    store, numbers = Store([], _CACHE_BYTES), itertools.count()
    for path in files:
        name = path.name if path == root else str(path.relative_to(root))
        if name in skip:
            continue
        try:
            entries, descriptions = entries_of(path)
        except _REFUSALS as error:
            yield name, _without(path, error)
            continue
        known = len(store.recordings)
        store.recordings += descriptions
        for entry in entries:
            episode = Episode(replace(entry, recording=known + entry.recording), next(numbers), store)
            for check in _CHECKS:
                try:
                    check(episode)
                except _REFUSALS as error:
                    yield f"{name} {entry.trajectory}", _without(path, error)
                    break  # the following checks would read the same again


def _without(path: Path, error: Exception) -> str:
    """One line without the path, which the place states."""
    text = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
    return " ".join(text.replace(f"{path} ", "").replace(f"{path}: ", "").split()) or type(error).__name__


def _check_text(episode: Episode) -> None:
    _ = episode.fps, episode.task


def _check_rows(episode: Episode) -> None:
    """Every dataset can be opened, has a row for each observation, and is small enough."""
    with open_h5(episode.path) as file:
        trajectory: Group = file[episode.trajectory]
        for place in trajectory.datasets():
            dataset = trajectory[place]
            if isinstance(dataset, Group) or place.startswith((VIDEOS, REPLAY)) or not dataset.is_number:
                continue
            dataset.rows_of(episode.length).check_whole()
            if is_json(dataset) and NUMBERS + place not in trajectory:
                decode(dataset.read(), dataset.where)


def _check_streams(episode: Episode) -> None:
    """Every dataset can be a stream, and has the type and shape that it has in the episode before. If the recording lists its
    streams, all of them are in every episode."""
    known, index = episode._store.known, episode._entry.recording
    before = known.pop(index, {})
    streams = episode.streams  # opens all datasets
    for place, stream in before.items():
        if stream is None:
            continue
        now = known[index].get(place)
        if now is not None and (now.dtype, now.shape) != (stream.dtype, stream.shape):
            raise ValueError(
                f"{place} is {now.dtype} {list(now.shape)}; in another episode of the recording it is "
                f"{stream.dtype} {list(stream.shape)}"
            )
        if stream.name not in streams and not place.startswith(_OPTIONAL) and "streams" in episode._recording.provenance:
            raise ValueError(f"has no '{place}', which another episode of the recording has")


def _check_videos(episode: Episode) -> None:
    for name in [name for name, stream in episode.streams.items() if stream.kind == "video"]:
        info = episode._video(name)
        episode.image_histogram(name)
        if have_av():
            # The program compares the checksum.
            packets = Packets(info.path, info.fps, info.frames, (info.width, info.height), "")
            exact = packets.exact or info.path.suffix == ".mkv" or episode._recording.fps is None
            if not exact or sorted(packets.frames) != list(range(info.frames)):
                raise ValueError(f"{info.path.name}: its times are not those of {info.frames} frames at {info.fps} per second")


def _check_replay(episode: Episode) -> None:
    with open_h5(episode.path) as file:
        trajectory: Group = file[episode.trajectory]
        if "replay" not in trajectory or not episode._recording.model_archive:
            return
        for _, name in trajectory.get(VIDEOS.rstrip("/"), {}).items():
            if len(name) != _NAME_BYTES:  # a rendering writes the new name in its place
                raise ValueError(f"{name.where} has {len(name)} bytes; the name of a video has {_NAME_BYTES}")
    playback.check_episode(episode)
    cameras = recorded_cameras(episode, None)
    if libmujoco.shared is not None:
        check_frames(cameras, playback.archived_model(episode), episode)


_CHECKS: tuple[Callable[[Episode], None], ...] = (_check_text, _check_rows, _check_streams, _check_videos, _check_replay)
