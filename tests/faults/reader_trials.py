# SPDX-License-Identifier: Apache-2.0
"""Runs all readers of the Python package on changed recordings, each recording in a process of its own (:func:`trials`): they may refuse it
by one line or read it, and nothing else.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import json
import os
import resource
import select
import shutil
import signal
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from crafted import SECRET
from generated import write_archive

CPU_SECONDS = 10  # that a reader may use
MEMORY = 1500 << 20  # bytes that a process of readers may use
_ADDRESS_SPACE = 12 << 30  # protects the machine; mappings of libraries and thread stacks count too
_IDLE = 120  # s without CPU time, after which a process of readers hangs; it may get little of a busy machine
_MODULES = ("mjsense.__main__", "mjsense.exporting", "mjsense.viewer.open", "h5py", "av", "pyarrow.parquet", "viser", "PIL.PngImagePlugin", "asyncio", "xml.etree.ElementTree")


def _read(path: Path) -> None:
    import mjsense as mjs

    data = mjs.Dataset(path)
    for i in range(0, len(data), 3):
        data[i]
    repr(data)
    data._repr_html_()
    data.stats(frames=2)
    for episode in data.episodes:
        _ = episode.quality, episode.task, episode.fps


def _view(path: Path) -> None:
    import mjsense as mjs

    viewer = mjs.view(path, block=False, port=0, open_browser=False)
    try:
        viewer.update()
        viewer.seek(3)
        viewer.update()
    finally:
        viewer.close()


def _run(words: list[str]) -> str:
    """Runs the program in this process. Returns what it wrote to stderr, or otherwise to stdout, if it refused its input."""
    from mjsense.__main__ import main

    files = [open(os.memfd_create("output"), "w+b") for _ in range(2)]  # noqa: SIM115
    saved = [os.dup(1), os.dup(2)]
    for number, file in enumerate(files, 1):
        os.dup2(file.fileno(), number)
    sys.argv = ["mjsense", *words]
    try:
        code = main()
    except SystemExit as end:
        code = end.code
    sys.stdout.flush()
    sys.stderr.flush()
    texts = []
    for number, (file, old) in enumerate(zip(files, saved), 1):
        os.dup2(old, number)
        os.close(old)
        file.seek(0)
        texts.append(file.read().decode(errors="replace"))
        file.close()
    return "" if code == 0 else texts[1] or texts[0] or f"exit code {code}"


def _readers(path: Path, out: Path, number: int) -> dict[str, Callable[[], Any]]:
    import mjsense as mjs

    exports = ("robomimic", "lerobot", "lerobot21")
    found: dict[str, Callable[[], Any]] = {
        "verify": lambda: _run(["verify", str(path)]),
        "dataset": lambda: _read(path),
        "replay": lambda: mjs.check_replay(path, states=number % 4 == 0, progress=False),
        "render": lambda: mjs.render(path, out / "rendered", width=16, num_worlds=1, threads=1, progress=False),
        "export": lambda: _run(["export", exports[number % 3], str(path), str(out / "exported"), "-q"]),
        "quality": lambda: _run(["quality", str(path)]),
        "inspect": lambda: _run(["inspect", str(path)]),
        "repair": lambda: _run(["repair", str(path)]),
    }
    if number % 3 == 0:
        found["view"] = lambda: _view(path)
    if number % 7 == 0:
        found["copies"] = lambda: mjs.render(path, out / "copied", num_worlds=1, threads=1, progress=False)
    return found


_ERRORS = ("ValueError", "OSError", "FileNotFoundError", "IsADirectoryError", "NotADirectoryError", "PermissionError", "RuntimeError", "UnknownNameError")


def _is_clear(reader: str, text: str) -> bool:
    """Whether a refusal is one line that names the file. (``verify`` has a line for each finding.)"""
    names = any(name in text for name in ("trajectories_batch_", "model_", "house_0", "/recording"))
    return names and "Traceback" not in text and (reader == "verify" or "\n" not in text.strip())


def read_all(path: Path, out: Path, number: int, report: Callable[[str, str, str], None]) -> None:
    """Runs all readers and reports the name of each, when it starts and how it ended: ``ok``, ``refused`` or ``wrong``, and the message."""
    for name, reader in _readers(path, out, number).items():
        report(name, "starts", "")
        try:
            text = reader()
            text = text if isinstance(text, str) else ""
            report(name, "ok" if not text else "refused" if _is_clear(name, text) else "wrong", text[-800:])
        except Exception as error:
            clear = type(error).__name__ in _ERRORS and not isinstance(error, UnicodeError) and _is_clear(name, str(error))
            report(name, "refused" if clear else "wrong", f"{type(error).__name__}: {error}"[:800])


class Watch:
    """Notices every opening of a file in a folder, by whatever process (inotify)."""

    def __init__(self, folder: Path) -> None:
        self._libc = ctypes.CDLL(None)
        self._fd = self._libc.inotify_init1(os.O_NONBLOCK)
        opened, read = 0x20, 0x1
        self._libc.inotify_add_watch(self._fd, os.fsencode(folder), opened | read)

    def noticed(self) -> list[str]:
        names = []
        while select.select([self._fd], [], [], 0)[0]:
            data = os.read(self._fd, 1 << 16)
            while data:
                size = int.from_bytes(data[12:16], sys.byteorder)
                names.append(data[16 : 16 + size].split(b"\0")[0].decode())
                data = data[16 + size :]
        return sorted({name for name in names if name})

    def close(self) -> None:
        os.close(self._fd)


class Outcome:
    """What a process of readers did."""

    def __init__(self) -> None:
        self.ended: dict[str, tuple[str, str]] = {}
        self.running = ""
        self.seconds: dict[str, float] = {}
        self.status = 0
        self.memory = 0
        self.hung = False


def _cpu_ticks(group: int) -> int:
    """CPU time of the processes of a group."""
    ticks = 0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            fields = stat.read_text().rpartition(")")[2].split()
            ticks += sum(map(int, fields[11:15])) if int(fields[2]) == group else 0
    return ticks


def run_readers(path: Path, out: Path, number: int) -> Outcome:
    """Runs :func:`read_all` in a child process with limits."""
    outcome = Outcome()
    reads, writes = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            os.setpgid(0, 0)
            os.close(reads)
            resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
            resource.setrlimit(resource.RLIMIT_CPU, (8 * CPU_SECONDS, 8 * CPU_SECONDS))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 30, 1 << 30))

            def report(name: str, state: str, text: str) -> None:
                os.write(writes, json.dumps([name, state, text, time.process_time()]).encode() + b"\n")

            read_all(path, out, number, report)
        finally:
            os._exit(0)
    os.close(writes)
    rest, started, ticks = b"", 0.0, -1
    while True:
        if not select.select([reads], [], [], _IDLE)[0]:
            if (now := _cpu_ticks(pid)) != ticks:
                ticks = now
                continue
            outcome.hung = True
            os.killpg(pid, signal.SIGKILL)
            break
        data = os.read(reads, 1 << 16)
        if not data:
            break
        *lines, rest = (rest + data).split(b"\n")
        for line in lines:
            name, state, text, seconds = json.loads(line)
            if state == "starts":
                outcome.running, started = name, seconds
            else:
                outcome.ended[name] = state, text
                outcome.seconds[name] = seconds - started
                outcome.running = ""
    os.close(reads)
    _, outcome.status, usage = os.wait4(pid, 0)
    outcome.memory = usage.ru_maxrss << 10
    return outcome


def _png(width: int, height: int) -> bytes:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")

    rows = zlib.compress((b"\0" + b"\x80\x40\x20" * width) * height)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


_PICTURE = _png(4, 4)


def make_base(folder: Path) -> Path:
    """A small recording of two episodes with color and depth videos and data for replay."""
    out = folder / "base"
    options = "--episodes 2 --worlds 1 --threads 1 --horizon 4 --keep-failures --cameras wrist_camera --size 32x24 --depth --no-shadows --seed 3 -q --no-sheet"
    # A process of its own, so that this one has no threads when it forks.
    subprocess.run([sys.executable, "-m", "mjsense", "record", "pick", "--robot", "franka", *options.split(), "--out", out], check=True)
    # Small textures: decoding them takes most of the time of reading the model.
    with zipfile.ZipFile(next(out.glob("house_0/model_*.zip"))) as archive:
        files = {name: _PICTURE if name.endswith(".png") else archive.read(name) for name in archive.namelist()}
    write_archive(out / "house_0", files, zipfile.ZIP_DEFLATED)
    return out


def make_secret(folder: Path) -> Path:
    """Files of the user, outside of the recording, that no reader may open."""
    secret = folder / "secret"
    secret.mkdir()
    (secret / "id_rsa").write_text("a private key")
    (secret / "part.xml").write_text('<mujoco><worldbody><geom name="from_secret" size=".1"/></worldbody></mujoco>')
    with h5py.File(secret / "other.h5", "w") as file:
        file["x"] = np.arange(50.0)[:, None]
    for name in ("private.mp4", "photo.png"):
        picture = "testsrc=size=32x24:rate=15"
        subprocess.run(["ffmpeg", "-v", "error", "-f", "lavfi", "-i", picture, "-frames:v", "1" if name.endswith("png") else "6", secret / name], check=True)
    encode = folder / "encode"
    encode.write_text(f"#!/bin/sh\ntouch {folder}/started\nexec ffmpeg \"$@\"\n")
    encode.chmod(0o755)
    return secret


Change = Callable[[Path, Path], str]
"""Changes the house of a recording, given the folder that no reader may open. Returns what was changed."""


def _files_beside(lab: Path) -> set[Path]:
    return {p for folder in (lab, lab / SECRET) if folder.is_dir() for p in folder.iterdir()}


def trials(folder: Path, changes: dict[int, Change], always_refused: bool = False) -> list[tuple[str, str]]:
    """Runs trials in a folder. Returns what went wrong: the column of the table, and a sentence.

    Args:
        always_refused: ``verify`` must refuse each of these recordings.
    """
    for module in _MODULES:  # before the forks, which then need not import them
        importlib.import_module(module)

    base, secret = make_base(folder), make_secret(folder)
    watch = Watch(secret)
    found: list[tuple[str, str]] = []
    for number, apply in changes.items():
        lab = folder / "a/b/c"
        shutil.rmtree(folder / "a", ignore_errors=True)
        (lab / "out").mkdir(parents=True)
        shutil.copytree(base, lab / "recording")
        what = apply(lab / "recording/house_0", secret)
        beside = _files_beside(lab)
        watch.noticed()
        of_change = [Watch(lab / SECRET)] if (lab / SECRET).is_dir() else []
        outcome = run_readers(lab / "recording", lab / "out", number)
        for one in (watch, *of_change):
            for name in one.noticed():
                found.append(("lost", f"{what}: secret/{name} was opened"))
        for one in of_change:
            one.close()
        if (folder / "started").exists():
            found.append(("lost", f"{what}: a program of the recording was started"))
            (folder / "started").unlink()
        outside = {p.name for p in folder.iterdir()} - {"base", "secret", "encode", "a"} | {p.name for p in [*lab.parent.iterdir(), *lab.parent.parent.iterdir()]} - {"b", "c"}
        if outside or _files_beside(lab) != beside:
            found.append(("lost", f"{what}: files were written outside of the output: {outside}"))
        if outcome.hung:
            found.append(("hung", f"{what}: {outcome.running} did not end"))
        elif outcome.status:
            found.append(("crashed", f"{what}: {outcome.running} ended with status {outcome.status}"))
        if outcome.memory > MEMORY:
            found.append(("crashed", f"{what}: {outcome.memory >> 20} MB of memory"))
        for name, (state, text) in outcome.ended.items():
            if state == "wrong":
                found.append(("crashed", f"{what}: {name}: {text}"))
            if outcome.seconds[name] > CPU_SECONDS:
                found.append(("hung", f"{what}: {name} used {outcome.seconds[name]:.0f} s"))
        if outcome.ended.get("verify", ("", ""))[0] == "ok":
            if always_refused:
                found.append(("unnoticed", f"{what}: verify calls it intact"))
            for name, (state, text) in outcome.ended.items():
                # MJCF, which robomimic's format needs, has no place for some fields. JSON rows may have other keys in each episode.
                if state == "refused" and not any(limit in text for limit in ("MJCF cannot express", "an episode has no stream")):
                    found.append(("unnoticed", f"{what}: verify calls it intact, but {name} refuses it: {text.strip()}"))
    watch.close()
    return found
