# SPDX-License-Identifier: Apache-2.0
"""HDF5 files of a recording. Every access opens the file and closes it again, so that no handle crosses a fork."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

INDEX = "index.parquet"
"""Index of a recording on a cluster."""
BATCH = re.compile(r"trajectories_batch_(\d+)_of_(\d+)\.h5")


def open_h5(path: Path) -> Any:
    """The file, opened for reading."""
    try:
        import h5py
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"Reading recordings needs h5py: pip install 'mjsense[dataset]' ({error})", name=error.name) from error
    return h5py.File(path, "r")


def video_options(recording: dict[str, Any]) -> dict[str, Any]:
    """The recorder's options that give equal videos of equal images. Recordings of older versions have no tuning."""
    about = {"tune": "", **recording["video"]} if "video" in recording else {}
    return {"encoder_threads" if key == "threads" else key: value for key, value in about.items()}


def text_of(value: Any) -> str:
    """A text attribute or a text dataset's value; a row of bytes ends at the first 0."""
    if isinstance(value, str):
        return value
    return bytes(value).split(b"\0", 1)[0].decode()


@dataclass(frozen=True)
class EpisodeEntry:
    """Where an episode is, and its attributes."""

    path: Path
    trajectory: str
    length: int
    house: int | None
    number: int
    seed: int | None
    outcome: str
    recording: int
    """Position in the list of the recordings' descriptions."""


def _indexed(root: Path) -> set[tuple[Path, str]] | None:
    """Files and trajectories that the index of a recording on a cluster names; None without an index."""
    index = root / INDEX
    if not index.exists():
        return None
    try:
        from pyarrow import parquet
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"Reading {index} needs pyarrow: pip install 'mjsense[ray]' ({error})", name=error.name) from error
    rows = parquet.read_table(index, columns=["path", "trajectory"]).to_pylist()
    return {(root / row["path"], row["trajectory"]) for row in rows}


def _batches(root: Path) -> list[Path]:
    """HDF5 files of a recording's folder, of one of its shards or houses, or the file itself, in the order of houses, shards and batches."""
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


def entries_of(root: Path) -> tuple[list[EpisodeEntry], list[dict[str, Any]]]:
    """All episodes of a recording, and the distinct descriptions of its files."""
    entries: list[EpisodeEntry] = []
    texts: dict[str, int] = {}
    indexed = _indexed(root)
    for path in _batches(root):
        house = re.fullmatch(r"house_(\d+)", path.parent.name)
        with open_h5(path) as file:
            recording = texts.setdefault(text_of(file.attrs.get("recording", "{}")), len(texts))
            for name in sorted((name for name in file if name.startswith("traj_") and (indexed is None or (path, name) in indexed)), key=lambda name: int(name[5:])):
                trajectory = file[name]
                flags = trajectory["success"]
                outcome = trajectory.attrs.get("outcome")
                if outcome is None:  # MolmoSpaces' files have no attributes
                    outcome = "success" if len(flags) and flags[-1] else "no success"
                seed = trajectory.attrs.get("seed")
                entries.append(EpisodeEntry(path, name, len(flags), int(house[1]) if house else None,
                                            int(trajectory.attrs.get("episode", int(name[5:]))), None if seed is None else int(seed),
                                            text_of(outcome), recording))  # fmt: skip
    return entries, [json.loads(text) for text in texts]
