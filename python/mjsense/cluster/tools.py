# SPDX-License-Identifier: Apache-2.0
"""``mjsense verify``, and ``inspect`` and ``repair`` of a recording with an index, or at an address.

The C++ program checks and shows the files. This module adds what the readers in Python refuse, and the comparison of the index with the
files of the shards.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.cluster.index import write_index
from mjsense.cluster.job import ShardResult
from mjsense.cluster.storage import Storage
from mjsense.dataset import check
from mjsense.dataset.files import INDEX, EpisodeEntry, entries_of, read_index
from mjsense.dataset.remote import is_address, resolved

TOOLS = ("inspect", "verify", "repair")
_ATTRIBUTES = ("length", "number", "seed", "outcome")


def path_of(words: list[str]) -> str | None:
    """The path of a command with these words if it is to be verified, or is a recording with an index or at an address."""
    if words[:1] and words[0] in TOOLS and not {"-h", "--help"} & {*words}:
        path = _parse(words[1:])[0].path or ""
        if (path and words[0] == "verify") or is_address(path) or Path(path).name == INDEX or any((Path(path) / name).exists() for name in (INDEX, "job.json")):
            return path
    return None


def _parse(words: list[str]) -> tuple[argparse.Namespace, list[str]]:
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("path", nargs="?")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--sheet")
    parser.add_argument("--ffmpeg")
    return parser.parse_known_args(words)


def run(words: list[str]) -> int:
    """Runs the command. Returns its exit code: 0: done, 1: something is damaged, 2: wrong input."""
    given, others = _parse(words[1:])
    options = [*others, *(["--ffmpeg", given.ffmpeg] if given.ffmpeg else [])]
    try:
        if words[0] == "verify":
            found = verify(given.path, *options)
            if found is None:
                return 2
            if given.json or not found["ok"] or not {"-q", "--quiet"} & {*others}:
                text = {key: value for key, value in found.items() if key != "of_job"}
                print(json.dumps(text, indent=2) if given.json else _verify_text(found))
            return 0 if found["ok"] else 1
        if words[0] == "repair":
            if options:
                raise ValueError(f"no option named '{options[0]}'; available: --help, --json")
            made = repair(given.path)
            lines = [*made["actions"], *(f"cannot repair {failure}" for failure in made["failures"])]
            print(json.dumps(made, indent=2) if given.json else "\n".join(lines) or "nothing to repair")
            return 1 if made["failures"] else 0
        sheet = ["--sheet", given.sheet] if given.sheet else []
        local, about = _summary(given.path)
        done = _program("inspect", local, *options, *sheet, *(["--json"] if given.json else []))
        print(json.dumps({"index": about, **json.loads(done)}, indent=2) if given.json else f"{_summary_text(about)}{done}", end="")
        return 0
    except (ValueError, LookupError, OSError, RuntimeError, ImportError) as error:
        print(f"mjsense {words[0]}: {' '.join(str(error).split())}", file=sys.stderr)
        return 2


def _program(command: str, path: Path, *options: str) -> str:
    """Output of the C++ program, which knows no index."""
    code = "import os, sys; from mjsense import _core; sys.exit(_core.run_program([b'mjsense', *map(os.fsencode, sys.argv[1:])], []))"
    done = subprocess.run([sys.executable, "-c", code, command, str(path), *options], capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise RuntimeError(done.stderr.strip().removeprefix("mjsense: ").removeprefix(f"{command}: "))
    return done.stdout


def _fetched(path: str) -> tuple[Path, list[dict[str, Any]] | None]:
    """The local folder of a recording with all files that its index names, and the rows of the index; None: it has none."""
    local, remote = resolved(path)
    if not (local / INDEX).exists():
        return local, None
    rows = read_index(local)
    if remote is not None:
        for folder in {(local / row["path"]).parent: None for row in rows}:
            remote.fetch(folder)
    return local, rows


def _summary(path: str) -> tuple[Path, dict[str, Any] | None]:
    """The local folder of a recording, and the counts of its index, if it has one."""
    local, rows = _fetched(path)
    if rows is None:
        return local, None
    tasks = Counter(row["task"] for row in rows)
    return local, {"episodes": len(rows), "successes": sum(row["success"] for row in rows), "observations": sum(row["length"] for row in rows),
                   "files": len({row["path"] for row in rows}), "instructions": len(tasks)}  # fmt: skip


def _summary_text(about: dict[str, Any] | None) -> str:
    if about is None:
        return f"no {INDEX}: the recording is not complete; the following counts the files that are there\n"
    return (f"{INDEX}  {about['episodes']} episodes, {about['successes']} successes, {about['observations']} observations, "
            f"{about['instructions']} instructions in {about['files']} files; the following counts whole files\n")  # fmt: skip


def _verified(path: Path, *options: str) -> dict[str, Any] | None:
    """Findings of the C++ program, which runs in this process and shows its progress; None: it has printed an error."""
    saved = os.dup(1)
    sys.stdout.flush()
    with tempfile.TemporaryFile() as output:
        try:
            os.dup2(output.fileno(), 1)
            code = _core.run_program([b"mjsense", b"verify", *map(os.fsencode, [str(path), "--json", *options])], [])
        finally:
            os.dup2(saved, 1)
            os.close(saved)
        output.seek(0)
        return json.loads(output.read()) if code in (0, 1) else None


def verify(path: str, *options: str) -> dict[str, Any] | None:
    """The result of ``mjsense verify --json``, with what readers refuse, and the comparison of an index with its files. None: the program has
    printed an error.

    Args:
        path: Folder, index or address of a recording.
        options: Further options of ``mjsense verify``.
    """
    local, rows = _fetched(path)
    found = _verified(local, *options)
    if found is None:
        return None
    damaged = {f["place"].split(" ")[0] for f in found["findings"] if f["error"]}
    found["findings"] += [{"error": True, "place": place, "text": text} for place, text in check.findings(local, damaged)]
    if rows is None:
        return found | {"ok": not any(f["error"] for f in found["findings"]), "of_job": (local / "job.json").exists()}
    shards = {row["path"].split("/")[0] for row in rows}
    # A shard that no row names may be incomplete: its worker may have died while it copied the files.
    findings = [f for f in found["findings"] if f["place"].split("/")[0].split(" ")[0] in shards or not f["place"].startswith("shard_")]
    findings += [{"error": True, "place": f"{INDEX} row {row}", "text": text} for row, text in _differences(local, rows)]
    return found | {"ok": not any(f["error"] for f in findings), "findings": findings, "indexed": len(rows)}


def _verify_text(found: dict[str, Any]) -> str:
    """The text of the C++ program: a note about many episodes is one line."""
    notes = Counter(f["text"] for f in found["findings"] if not f["error"])
    lines: list[str] = []
    for f in found["findings"]:
        if f["error"]:
            lines.append(f"error: {f['place']} {f['text']}")
        elif same := notes.pop(f["text"], 0):
            lines.append(f"note: {f['place']} {f['text']}" + (f" (and {same - 1} more)" if same > 1 else ""))
    counts = f"{found['files']} files, {found['episodes']} episodes, {found['steps']} observations, {found['videos']} videos"
    counts += f", {found['unpublished']} episodes not published" if found["unpublished"] else ""
    counts += f"; {found['indexed']} episodes in {INDEX}" if "indexed" in found else f"; no {INDEX}: the recording is not complete" if found.get("of_job") else ""
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
            found += [(number, f"{name} is {ours[name]!r}, but {getattr(entry, name)!r} in {row['path']} {row['trajectory']}")
                      for name in _ATTRIBUTES if ours[name] != getattr(entry, name)]  # fmt: skip
        house = Path(row["path"]).parent.name
        if row["episode"] <= before.get(house, -1):
            found.append((number, f"episode {row['episode']} follows episode {before[house]}: the order is wrong, or one is there twice"))
        before[house] = row["episode"]
    return found


def repair(path: str) -> dict[str, list[str]]:
    """Makes the index agree with the shards: a shard that is damaged is no longer marked as done, so that ``record --resume`` records it
    again, and the index is written anew from the complete shards without a gap. Nothing is deleted but marks.

    Returns:
        ``actions`` and ``failures``: sentences.
    """
    address = path if is_address(path) else str(resolved(path)[0])
    address = address.rstrip("/").removesuffix(f"/{INDEX}")
    storage = Storage(address)
    made: dict[str, list[str]] = {"actions": [], "failures": []}
    if storage.read("job.json") is None:
        return json.loads(_program("repair", _fetched(path)[0], "--json"))
    local, rows = _fetched(path)
    remote = resolved(path)[1]
    damaged: dict[str, str] = {}
    if any(local.glob("shard_*/*/*.h5")):
        for finding in json.loads(_program("verify", local, "--json"))["findings"]:
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
        made["actions"].append(f"{INDEX}: written with the {kept} episodes of {count} complete shards")
    return made
