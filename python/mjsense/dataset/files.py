# SPDX-License-Identifier: Apache-2.0
"""The files and episodes of a recording. Every access opens a file and closes it again, so that no handle crosses a fork."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from mjsense.core.input_files import missing
from mjsense.dataset import index
from mjsense.dataset.description import Description
from mjsense.dataset.hdf5 import Group, open_h5
from mjsense.dataset.hdf5_rows import Rows
from mjsense.dataset.limits import DESCRIPTION_BYTES
from mjsense.dataset.places import plain_folder, printable

INDEX = "index.parquet"
"""Index of a recording on a cluster."""
BATCH = re.compile(r"trajectories_batch_([0-9]{1,9})_of_([0-9]{1,9})\.h5")
_TRAJECTORY = re.compile(r"traj_(0|[1-9][0-9]{0,8})")
_OUTCOMES = ("no success", "success")


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
    return index.rows_of(root / INDEX)


def _description(file: Group, path: Path) -> Description:
    return Description.parse(file.attrs.text("recording", "{}", DESCRIPTION_BYTES), str(path))


def _indexed(root: Path, source: Fetcher | None) -> tuple[list[EpisodeEntry], list[Description]]:
    """The episodes that an index names. Only one file of each house is opened: all shards of a job have the same description."""
    entries: list[EpisodeEntry] = []
    descriptions: list[Description] = []
    of_house: dict[str, int] = {}
    folders: set[Path] = set()
    for row in read_index(root):
        place = root / row["path"]
        house = place.parent.name
        entry = EpisodeEntry(
            place,
            row["trajectory"],
            row["length"],
            _house(place),
            row["episode"],
            row["seed"],
            row["outcome"],
            of_house.setdefault(house, len(of_house)),
            source,
        )
        if source is None:
            _plain_folders(root, place, folders)
        if entry.recording == len(descriptions):
            with open_h5(entry.path) as file:
                descriptions.append(_description(file, place))
        entries.append(entry)
    return entries, descriptions


def _house(path: Path) -> int | None:
    match = re.fullmatch(r"house_([0-9]{1,9})", path.parent.name)
    return int(match[1]) if match else None


def batches(root: Path) -> list[Path]:
    """HDF5 files of a recording's folder, of one of its shards or houses, or the file itself, in the order of houses, shards and
    batches."""
    if not root.exists():
        raise missing(root)
    if not root.is_dir():
        return [root]
    found = [path for folder in ("", "house_*/", "shard_*/house_*/") for path in root.glob(f"{folder}trajectories_batch_*.h5")]
    if (root / "job.json").exists():  # recorded on a cluster: a shard without done.json may be incomplete
        found = [path for path in found if (path.parents[1] / "done.json").exists()]

    def order(path: Path) -> tuple[str | int, ...]:
        house, batch = re.fullmatch(r"house_([0-9]{1,9})", path.parent.name), BATCH.fullmatch(path.name)
        shard = re.fullmatch(r"shard_([0-9]{1,9})", path.parent.parent.name)
        return "" if house else path.parent.name, *(int(match[1]) if match else 0 for match in (house, shard, batch))

    if not found:
        waiting = any(root.glob("**/.recording"))
        hint = ": it is unfinished; `mjsense repair` publishes its episodes" if waiting else ""
        raise FileNotFoundError(f"{root} contains no recording (house_*/trajectories_batch_*.h5){hint}")
    folders: set[Path] = set()
    for path in found:
        _plain_folders(root, path, folders)
    return sorted(found, key=order)


def _plain_folders(root: Path, file: Path, known: set[Path]) -> None:
    """Raises an error if one of the folders between a recording's folder and one of its files is a link."""
    for folder in (file.parent, file.parents[1]):
        if folder not in known and root in folder.parents:
            plain_folder(folder)
            known.add(folder)


def is_unfinished(root: Path) -> bool:
    """Whether more episodes may follow, or wait to be published. An index is written at the end of a recording."""
    if (root / INDEX).exists():
        return False
    return (root / "job.json").exists() or any(
        any(root.glob(f"{folder}.recording")) for folder in ("", "house_*/", "shard_*/house_*/")
    )


def entries_of(root: Path, source: Fetcher | None = None) -> tuple[list[EpisodeEntry], list[Description]]:
    """All episodes of a recording, and the distinct descriptions of its files.

    Args:
        root: Folder or file.
        source: Where the folders of the episodes come from, if ``root`` contains only an index.
    """
    if (root / INDEX).exists():
        return _indexed(root, source)
    entries: list[EpisodeEntry] = []
    texts: dict[str, int] = {}
    descriptions: list[Description] = []
    for path in batches(root):
        with open_h5(path) as file:
            text = file.attrs.text("recording", "{}", DESCRIPTION_BYTES)
            if text not in texts:
                descriptions.append(_description(file, path))
                texts[text] = len(texts)
            entries += _episodes(file, path, texts[text])
    return entries, descriptions


def _episodes(file: Group, path: Path, recording: int) -> Iterator[EpisodeEntry]:
    """The episodes of a file, in the order of their numbers."""
    names = [name for name in file if name.startswith("traj_")]
    for name in names:
        if not _TRAJECTORY.fullmatch(name):
            raise ValueError(f"{path} has a trajectory named '{printable(name[:100])}'; it must be traj_0, traj_1 and so on")
    for name in sorted(names, key=lambda name: int(name[5:])):
        trajectory = file[name]
        if not isinstance(trajectory, Group):
            raise ValueError(f"{trajectory.where} is an array; it must be a group")
        flags = trajectory.get("success")
        if flags is None:
            raise ValueError(f"{trajectory.where} has no dataset 'success'")
        if not isinstance(flags, Rows) or flags.ndim != 1 or not flags.is_number:
            raise ValueError(
                f"{flags.where} is {getattr(flags, 'dtype', 'a group')} {list(getattr(flags, 'shape', ()))}; it "
                "must be one bool for each observation"
            )
        outcome = trajectory.attrs.text("outcome") if "outcome" in trajectory.attrs else None
        if outcome is None:  # MolmoSpaces' files have no attributes
            outcome = _OUTCOMES[bool(len(flags) and flags[-1])]
        number = trajectory.attrs.integer("episode", 0, 2**53)
        yield EpisodeEntry(
            path,
            name,
            len(flags),
            _house(path),
            int(name[5:]) if number is None else number,
            trajectory.attrs.integer("seed", 0, 2**64 - 1),
            outcome,
            recording,
        )
