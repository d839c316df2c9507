# SPDX-License-Identifier: Apache-2.0
"""``mjsense inspect``, ``verify`` and ``repair``: of a folder or a file, of a recording with an index, or at an address.

The C++ library checks and shows the files. This module adds what the readers in Python refuse, and the comparison of the index
with the files of the shards.
"""

from __future__ import annotations

import json
import os
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.cluster.index import write_index
from mjsense.cluster.job import ShardResult
from mjsense.cluster.storage import Storage
from mjsense.core.counted import counted
from mjsense.core.optional import optional
from mjsense.dataset import check
from mjsense.dataset.files import INDEX, EpisodeEntry, entries_of, read_index
from mjsense.dataset.remote import is_address, resolved

_ATTRIBUTES = ("length", "number", "seed", "outcome")


def _fetched(path: str) -> tuple[Path, list[dict[str, Any]] | None]:
    """The local folder of a recording with all files that its index names, and the rows of the index; None: it has none."""
    local, remote = resolved(path)
    if not os.path.exists(local if path else path):
        raise ValueError(f"{path or repr(path)}: no such file or directory")
    if not (local / INDEX).exists():
        return local, None
    rows = read_index(local)
    if remote is not None:
        for folder in {(local / row["path"]).parent: None for row in rows}:
            remote.fetch(folder)
    return local, rows


def inspect(path: str) -> tuple[Path, str, str]:
    """The local folder of a recording, its contents and statistics as text, and as JSON."""
    local, rows = _fetched(path)
    found, as_json = _core.inspect(local)
    text = found.decode(errors="surrogateescape").rstrip("\n")
    if rows is None and not (local / "job.json").exists() and not is_address(path):
        return local, text, as_json
    about = None
    if rows is not None:
        about = {
            "episodes": len(rows),
            "successes": sum(row["success"] for row in rows),
            "observations": sum(row["length"] for row in rows),
            "files": len({row["path"] for row in rows}),
            "instructions": len({row["task"] for row in rows}),
        }
    return local, _summary_text(about) + text, json.dumps({"index": about, **json.loads(as_json)}, indent=2)


def _summary_text(about: dict[str, Any] | None) -> str:
    if about is None:
        return f"no {INDEX}: the recording is not complete; the following counts the files that are there\n"
    return (
        f"{INDEX}  {counted(about['episodes'], 'episode')}, {counted(about['successes'], 'success')}, "
        f"{counted(about['observations'], 'observation')}, "
        f"{counted(about['instructions'], 'instruction')} in {counted(about['files'], 'file')}; "
        "the following counts whole files\n"
    )


def verify(path: str, *, decode: bool = False, ffmpeg: str = "", progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """The result of ``mjsense verify --json``: whether a recording is complete and undamaged, with what readers refuse, and the
    comparison of an index with its files.

    Args:
        path: Folder, file, index or address of a recording.
        decode: Decode every frame of the videos.
        ffmpeg: Path of the ffmpeg program; by default the one in ``PATH``.
        progress: Called with a text after each file.
    """
    local, rows = _fetched(path)
    optional("h5py", "dataset", "mjsense verify")
    found = json.loads(_core.verify(local, decode, ffmpeg, progress))
    damaged = {f["place"].split(" ")[0] for f in found["findings"] if f["error"]}
    found["findings"] += [{"error": True, "place": place, "text": text} for place, text in check.findings(local, damaged)]
    if rows is None:
        return found | {"ok": not any(f["error"] for f in found["findings"]), "of_job": (local / "job.json").exists()}
    shards = {row["path"].split("/")[0] for row in rows}
    # A shard that no row names may be incomplete: its worker may have died while it copied the files.
    findings = [
        f for f in found["findings"] if f["place"].split("/")[0].split(" ")[0] in shards or not f["place"].startswith("shard_")
    ]
    findings += [{"error": True, "place": f"{INDEX} row {row}", "text": text} for row, text in _differences(local, rows)]
    return found | {"ok": not any(f["error"] for f in findings), "findings": findings, "indexed": len(rows)}


def verify_text(found: dict[str, Any]) -> str:
    """The result of ``verify`` for people: a note about many episodes is one line."""
    notes = Counter(f["text"] for f in found["findings"] if not f["error"])
    lines: list[str] = []
    for f in found["findings"]:
        if f["error"]:
            lines.append(f"error: {f['place']} {f['text']}")
        elif same := notes.pop(f["text"], 0):
            lines.append(f"note: {f['place']} {f['text']}" + (f" (and {same - 1} more)" if same > 1 else ""))
    nouns = {"files": "file", "episodes": "episode", "steps": "observation", "videos": "video"}
    counts = ", ".join(counted(found[name], noun) for name, noun in nouns.items())
    counts += f", {counted(found['unpublished'], 'episode')} not published" if found["unpublished"] else ""
    counts += (
        f"; {counted(found['indexed'], 'episode')} in {INDEX}"
        if "indexed" in found
        else f"; no {INDEX}: the recording is not complete"
        if found.get("of_job")
        else ""
    )
    return "\n".join([*lines, f"{'intact' if found['ok'] else 'NOT intact'}: {counts}"])


def _differences(local: Path, rows: list[dict[str, Any]]) -> list[tuple[int, str]]:
    """Rows of the index that differ from the files, and how."""
    found: list[tuple[int, str]] = []
    files: dict[str, dict[str, EpisodeEntry] | str] = {}
    before: dict[str, int] = {}
    for number, row in enumerate(rows):
        if row["path"] not in files:
            try:
                files[row["path"]] = {entry.trajectory: entry for entry in entries_of(local / row["path"])[0]}
            except (OSError, KeyError, ValueError) as error:
                files[row["path"]] = " ".join(str(error).split())
        file = files[row["path"]]
        if isinstance(file, str):
            found.append((number, f"{row['path']} cannot be read: {file}"))
        elif (entry := file.get(row["trajectory"])) is None:
            found.append((number, f"{row['path']} has no {row['trajectory']}"))
        else:
            ours = row | {"number": row["episode"]}
            found += [
                (number, f"{name} is {ours[name]!r}, but {getattr(entry, name)!r} in {row['path']} {row['trajectory']}")
                for name in _ATTRIBUTES
                if ours[name] != getattr(entry, name)
            ]
        house = Path(row["path"]).parent.name
        if row["episode"] <= before.get(house, -1):
            found.append(
                (number, f"episode {row['episode']} follows episode {before[house]}: the order is wrong, or one is there twice")
            )
        before[house] = row["episode"]
    return found


def repair(path: str) -> dict[str, list[str]]:
    """Publishes the finished episodes of an interrupted recording. Of a recording with an index: makes the index agree with the
    shards: a shard that is damaged is no longer marked as done, so that ``record --resume`` records it again, and the index is
        written anew from the complete shards without a gap. Nothing is deleted but marks.

    Returns:
        ``actions`` and ``failures``: sentences.
    """
    if not is_address(path) and not (_fetched(path)[0] / "job.json").exists():
        return json.loads(_core.repair(_fetched(path)[0]))
    address = path if is_address(path) else str(resolved(path)[0])
    address = address.rstrip("/").removesuffix(f"/{INDEX}")
    storage = Storage(address)
    made: dict[str, list[str]] = {"actions": [], "failures": []}
    if storage.read("job.json") is None:
        return json.loads(_core.repair(_fetched(path)[0]))
    local, rows = _fetched(path)
    remote = resolved(path)[1]
    damaged: dict[str, str] = {}
    if any(local.glob("shard_*/*/*.h5")):
        for finding in json.loads(_core.verify(local, False, "", None))["findings"]:
            if finding["error"]:
                damaged.setdefault(finding["place"].split("/")[0], f"{finding['place']} {finding['text']}")
    done: dict[int, ShardResult] = {}
    for name in storage.find("shard_*/done.json"):
        folder = name.split("/")[0]
        try:
            result = ShardResult.parse(storage.read(name) or b"")
            missing = next((row["path"] for row in result.episodes if not storage.exists(f"{folder}/{row['path']}")), None)
            why = damaged.get(folder) or (f"{missing} does not exist" if missing else "")
        except (ValueError, TypeError, KeyError) as error:
            result, why = None, f"done.json cannot be read: {error}"
        if result is None or why:
            storage.remove(name)
            if remote is not None:  # the index may stay equal, so that the copy on this machine would be read again
                shutil.rmtree(local / folder, ignore_errors=True)
            made["actions"].append(f"{folder}: {why}. It is no longer marked as done; mjsense record --resume records it again")
        else:
            done[result.shard.number] = result
    count = 0
    while count in done:
        count += 1
    limit = len(rows) if rows is not None else sum(len(done[n].episodes) for n in range(count))
    before = storage.read(INDEX)
    kept = write_index(storage, [done[n] for n in range(count)], limit)
    if storage.read(INDEX) != before:
        made["actions"].append(f"{INDEX}: written with the {counted(kept, 'episode')} of {count} complete shards")
    return made
