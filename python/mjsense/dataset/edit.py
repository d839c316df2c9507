# SPDX-License-Identifier: Apache-2.0
"""Recordings without some episodes, parts of recordings, and several recordings as one. Arrays, videos and checksums stay as they
are."""

from __future__ import annotations

import math
import shutil
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from mjsense.core.arguments import checked
from mjsense.core.new_output import new_output
from mjsense.core.optional import optional
from mjsense.dataset.dataset import Dataset
from mjsense.dataset.episode import Episode
from mjsense.dataset.hdf5 import open_h5
from mjsense.dataset.hdf5_values import Attributes, text_of
from mjsense.dataset.places import open_plain, plain_name
from mjsense.dataset.streams import VIDEOS


@checked
def delete_episodes(root: str | Path, out: str | Path, episodes: Iterable[int]) -> Path:
    """Writes a recording without some of its episodes as a new recording. See docs/datasets.md.

    Args:
        root: Recording: its folder, an index, one of its ``house_N`` folders, or one HDF5 file.
        out: Folder to write. It must not exist.
        episodes: Positions of the episodes to leave out.

    Returns:
        ``out``.
    """
    every = Dataset(root).episodes
    leave_out = set(_positions("episodes", episodes, every))
    if len(leave_out) == len(every):
        raise ValueError(f"{root}: all {len(every)} episodes are to be deleted; a recording has at least one")
    return _write([episode for episode in every if episode.index not in leave_out], Path(out))


@checked
def split_dataset(root: str | Path, out: str | Path, parts: Mapping[str, Any]) -> dict[str, Path]:
    """Writes parts of a recording as new recordings in the folders ``out/NAME``. See docs/datasets.md.

    Args:
        root: Recording: its folder, an index, one of its ``house_N`` folders, or one HDF5 file.
        out: Folder of the parts. It must not exist.
        parts: By name either the positions of a part's episodes, or its share of all episodes, 0 to 1:
            ``{"train": 0.8, "test": 0.2}``. Shares are taken in the order of the names, from the first episode on.

    Returns:
        The folders by name.
    """
    every = Dataset(root).episodes
    chosen: dict[str, list[int]] = {}
    share, begin = 0.0, 0
    for name, part in parts.items():
        if not name or Path(name).name != name or name.startswith("."):
            raise ValueError(f"parts: '{name}' cannot be the name of a folder")
        if isinstance(part, (int, float)) and not isinstance(part, bool):
            if not 0 < part <= 1 or share + part > 1 + 1e-9:
                raise ValueError(f"parts: the share of '{name}' is {part}; shares are above 0 and at most 1 together")
            share += part
            end = math.floor(share * len(every) + 0.5)
            chosen[name], begin = list(range(begin, end)), end
        else:
            chosen[name] = sorted(set(_positions(f"parts: '{name}'", part, every)))
        if not chosen[name]:
            raise ValueError(f"parts: '{name}' has no episode; {root} has {len(every)}")
    if not chosen:
        raise ValueError("parts: at least one part is needed")
    with new_output(out) as folder:
        folder.mkdir()
        for name, positions in chosen.items():
            _write([every[i] for i in positions], folder / name)
    return {name: Path(out) / name for name in chosen}


@checked
def merge_datasets(roots: Iterable[str | Path], out: str | Path) -> Path:
    """Writes the episodes of several recordings as one new recording, in the order of the recordings. See docs/datasets.md.

    Each keeps its own ``house_N`` folders, whose numbers change if two are equal.

    Args:
        roots: Recordings, which have the same rate.
        out: Folder to write. It must not exist.

    Returns:
        ``out``.
    """
    read = [Dataset(root) for root in roots]
    if not read:
        raise ValueError("merge_datasets: at least one recording is needed")
    rates = {dataset.fps: dataset.root for dataset in read}
    if len(rates) > 1:
        raise ValueError(
            "merge_datasets: "
            + ", ".join(f"{root} has {fps}" for fps, root in rates.items())
            + " observations per second; a data set has one rate"
        )
    return _write([episode for dataset in read for episode in dataset.episodes], Path(out))


def _positions(what: str, given: Any, every: list[Episode]) -> list[int]:
    positions = [int(i) for i in given]
    if wrong := [i for i in positions if not 0 <= i < len(every)]:
        raise ValueError(f"{what}: {wrong[0]} is not the position of an episode: 0 to {len(every) - 1}")
    return positions


def _write(episodes: list[Episode], out: Path) -> Path:
    folders: dict[Path, dict[Path, list[Episode]]] = {}
    for episode in episodes:
        folders.setdefault(episode.path.parent, {}).setdefault(episode.path, []).append(episode)
    with new_output(out) as path:
        path.mkdir()
        houses: set[int] = set()
        for files in folders.values():
            number = next(iter(files.values()))[0].house or 0
            number = number if number not in houses else max(houses) + 1
            houses.add(number)
            house = path / f"house_{number}"
            house.mkdir()
            for k, (file, kept) in enumerate(files.items(), 1):
                _copy_batch(file, kept, house / f"trajectories_batch_{k}_of_{len(files)}.h5")
    return out


def _copy_batch(source: Path, episodes: list[Episode], target: Path) -> None:
    """Copies episodes of an HDF5 file, their videos and the archive of their model. The bytes of a file of which all are copied
    stay equal."""
    names = {archive} if (archive := episodes[0]._recording.model_archive) else set()
    with open_h5(source) as file:
        every = [name for name in file if name.startswith("traj_")]
        for group in (file[episode.trajectory] for episode in episodes):
            for place in group.datasets():
                rows = group[place]  # checks how it is stored
                # The checksum of a video's name is that of the video.
                if place.startswith(VIDEOS) and rows.ndim == 1 and (name := text_of(rows[0 : len(rows)])):
                    names.add(plain_name(name, f"{rows.where}: the video"))
    for name in sorted(names):
        if not (target.parent / name).exists():
            _copy(source.parent / name, target.parent / name)
    if len(episodes) == len(every):
        _copy(source, target)
        return
    h5py = optional("h5py", "dataset", "Editing recordings")
    with open_plain(source) as plain, h5py.File(f"/proc/self/fd/{plain.fileno()}", "r") as old, h5py.File(target, "w") as new:
        attributes = Attributes(old, str(source))
        for name in old.attrs:
            new.attrs[name] = attributes[name]
        for k, episode in enumerate(episodes):
            old.copy(episode.trajectory, new, f"traj_{k}")
    _seal(target)


def _copy(source: Path, target: Path) -> None:
    with open_plain(source) as old, open(target, "xb") as new:
        shutil.copyfileobj(old, new)


def _seal(path: Path) -> None:
    """Appends the line with the checksum of the file, as the recorder does, which HDF5 ignores."""
    with open(path, "rb+") as file:
        crc = size = 0
        while piece := file.read(1 << 20):
            crc, size = zlib.crc32(piece, crc), size + len(piece)
        file.write(f"\nmjsense: crc32 {crc:08x} of the {size:>16} bytes above\n".encode())
