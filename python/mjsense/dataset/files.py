# SPDX-License-Identifier: Apache-2.0
"""HDF5 files of a recording. Every access opens the file and closes it again, so that no handle crosses a fork."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from mjsense._input_files import missing, unreadable
from mjsense._optional import optional

INDEX = "index.parquet"
"""Index of a recording on a cluster."""
BATCH = re.compile(r"trajectories_batch_(\d+)_of_(\d+)\.h5")


def open_h5(path: Path) -> Any:
    """The file, opened for reading."""
    h5py = optional("h5py", "dataset", "Reading recordings")
    try:
        return h5py.File(path, "r")
    except OSError as error:
        raise unreadable(path, error, "an HDF5 file") from None


def video_options(recording: dict[str, Any]) -> dict[str, Any]:
    """The recorder's options that give equal videos of equal images. Recordings of older versions have no tuning."""
    about = {"tune": "", **recording["video"]} if "video" in recording else {}
    return {"encoder_threads" if key == "threads" else key: value for key, value in about.items()}


def text_of(value: Any) -> str:
    """A text attribute or a text dataset's value; a row of bytes ends at the first 0."""
    if isinstance(value, str):
        return value
    return bytes(value).split(b"\0", 1)[0].decode()


class Fetcher(Protocol):
    """Brings a folder of a recording onto this machine."""

    def fetch(self, folder: Path) -> None: ...


@dataclass(frozen=True)
class EpisodeEntry:
    """Where an episode is, and its attributes."""

    place: Path
    """The HDF5 file, which need not be on this machine yet."""
    trajectory: str
    length: int
    house: int | None
    number: int
    seed: int | None
    outcome: str
    recording: int
    """Position in the list of the recordings' descriptions."""
    source: Fetcher | None = None
    """Where the file's folder comes from; None: it is on this machine."""

    @property
    def path(self) -> Path:
        """The HDF5 file, on this machine."""
        if self.source is not None:
            self.source.fetch(self.place.parent)
        return self.place


def read_index(root: Path) -> list[dict[str, Any]]:
    """The rows of ``index.parquet``."""
    index = root / INDEX
    parquet = optional("pyarrow.parquet", "ray", f"Reading {index}")
    return parquet.read_table(index).to_pylist()


def _indexed(root: Path, source: Fetcher | None) -> tuple[list[EpisodeEntry], list[dict[str, Any]]]:
    """The episodes that an index names. Only one file of each house is opened: all shards of a job have the same description."""
    entries: list[EpisodeEntry] = []
    descriptions: list[dict[str, Any]] = []
    of_house: dict[str, int] = {}
    for row in read_index(root):
        place = root / row["path"]
        house = place.parent.name
        entry = EpisodeEntry(place, row["trajectory"], row["length"], _house(place), row["episode"], row["seed"], row["outcome"],
                             of_house.setdefault(house, len(of_house)), source)  # fmt: skip
        if entry.recording == len(descriptions):
            with open_h5(entry.path) as file:
                descriptions.append(json.loads(text_of(file.attrs.get("recording", "{}"))))
        entries.append(entry)
    return entries, descriptions


def _house(path: Path) -> int | None:
    match = re.fullmatch(r"house_(\d+)", path.parent.name)
    return int(match[1]) if match else None


def _batches(root: Path) -> list[Path]:
    """HDF5 files of a recording's folder, of one of its shards or houses, or the file itself, in the order of houses, shards and batches."""
    if not root.exists():
        raise missing(root)
    if root.is_file():
        return [root]
    found = [path for folder in ("", "house_*/", "shard_*/house_*/") for path in root.glob(f"{folder}trajectories_batch_*.h5")]
    if (root / "job.json").exists():  # recorded on a cluster: a shard without done.json may be incomplete
        found = [path for path in found if (path.parents[1] / "done.json").exists()]

    def order(path: Path) -> tuple[str | int, ...]:
        house, batch = re.fullmatch(r"house_(\d+)", path.parent.name), BATCH.fullmatch(path.name)
        shard = re.fullmatch(r"shard_(\d+)", path.parent.parent.name)
        return "" if house else path.parent.name, *(int(match[1]) if match else 0 for match in (house, shard, batch))

    if not found:
        waiting = any(root.glob("**/.recording"))
        hint = ": it is unfinished; `mjsense repair` publishes its episodes" if waiting else ""
        raise FileNotFoundError(f"{root} contains no recording (house_*/trajectories_batch_*.h5){hint}")
    return sorted(found, key=order)


def is_unfinished(root: Path) -> bool:
    """Whether more episodes may follow, or wait to be published. An index is written at the end of a recording."""
    if (root / INDEX).exists():
        return False
    return (root / "job.json").exists() or any(any(root.glob(f"{folder}.recording")) for folder in ("", "house_*/", "shard_*/house_*/"))


def entries_of(root: Path, source: Fetcher | None = None) -> tuple[list[EpisodeEntry], list[dict[str, Any]]]:
    """All episodes of a recording, and the distinct descriptions of its files.

    Args:
        root: Folder or file.
        source: Where the folders of the episodes come from, if ``root`` contains only an index.
    """
    if (root / INDEX).exists():
        return _indexed(root, source)
    entries: list[EpisodeEntry] = []
    texts: dict[str, int] = {}
    for path in _batches(root):
        with open_h5(path) as file:
            recording = texts.setdefault(text_of(file.attrs.get("recording", "{}")), len(texts))
            for name in sorted((name for name in file if name.startswith("traj_")), key=lambda name: int(name[5:])):
                trajectory = file[name]
                flags = trajectory["success"]
                outcome = trajectory.attrs.get("outcome")
                if outcome is None:  # MolmoSpaces' files have no attributes
                    outcome = "success" if len(flags) and flags[-1] else "no success"
                seed = trajectory.attrs.get("seed")
                entries.append(EpisodeEntry(path, name, len(flags), _house(path), int(trajectory.attrs.get("episode", int(name[5:]))),
                                            None if seed is None else int(seed), text_of(outcome), recording))  # fmt: skip
    return entries, [json.loads(text) for text in texts]
