# SPDX-License-Identifier: Apache-2.0
"""Runs the mjsense program: `python -m mjsense`, or the words of $MJSENSE_PROGRAM.

Loading the library takes most of the time of a short command. Therefore runs are forked from a process that has loaded it, unless
they need a process of their own.
"""

import multiprocessing
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

PROGRAM = shlex.split(os.environ.get("MJSENSE_PROGRAM", "")) or [sys.executable, "-m", "mjsense"]

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["mjsense.commands.start", "program_runs"])

_environment = None
"""The environment variables of the process from which runs are forked."""


def _run(words, cwd, stdout, stderr):
    from mjsense.__main__ import main

    for descriptor, path in ((1, stdout), (2, stderr)):
        with open(path, "wb") as file:
            os.dup2(file.fileno(), descriptor)
    os.chdir(cwd)
    sys.argv = ["mjsense", *words]
    sys.exit(main())


def run_program(*words, cwd=None, env=None, timeout=300, alone=False, **kwargs):
    """Runs the program like subprocess.run(), and returns its outputs as text.

    With `alone` it is started as users start it. So it is, too, if `env` or this process changes environment variables, and with
    further arguments of subprocess.run(). Otherwise it is forked, and has the sys.path of this process.
    """
    global _environment
    words = [str(word) for word in words]
    now = {name: value for name, value in os.environ.items() if name != "PYTEST_CURRENT_TEST"}
    _environment = _environment or now
    if alone or env or kwargs or "MJSENSE_PROGRAM" in os.environ or now != _environment:
        return subprocess.run(
            [*PROGRAM, *words], cwd=cwd, env={**os.environ, **(env or {})}, capture_output=True, text=True, timeout=timeout, **kwargs)
    with tempfile.TemporaryDirectory() as folder:
        outputs = [Path(folder, name) for name in ("stdout", "stderr")]
        process = _FORKS.Process(target=_run, args=(words, cwd or os.getcwd(), *outputs))
        process.start()
        process.join(timeout)
        if process.exitcode is None:
            process.kill()
            process.join()
            raise subprocess.TimeoutExpired(words, timeout)
        return subprocess.CompletedProcess(words, process.exitcode, *(path.read_text() for path in outputs))
