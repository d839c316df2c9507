# SPDX-License-Identifier: Apache-2.0
"""A call in a process of its own, which tells how the process ended. Ray does not report the signal that ended a worker."""

from __future__ import annotations

import ctypes
import os
import pickle
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mjsense.cluster.scratch import scratch_folder

_FROM_OUTSIDE = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP)
_PR_SET_PDEATHSIG = 1


@dataclass(frozen=True)
class Death:
    """The end of a process that did not return a result."""

    code: int
    """Exit code; negative: a signal."""
    machine: str
    place: str
    """The innermost call that Python's fault handler reports; may be empty."""

    @property
    def from_outside(self) -> bool:
        """Whether another process ended it, such as the kernel for lack of memory."""
        return -self.code in _FROM_OUTSIDE

    @property
    def how(self) -> str:
        """``SIGSEGV``, ``exit code 3``"""
        return signal.Signals(-self.code).name if self.code < 0 else f"exit code {self.code}"


@dataclass(frozen=True)
class Outcome:
    """Result of :func:`alone`."""

    value: Any
    death: Death | None


def alone(function: Callable[..., Any], arguments: tuple[Any, ...]) -> Outcome:
    """Calls a function in a new process. Raises its exceptions."""
    import ray  # pyright: ignore[reportMissingImports]

    with scratch_folder() as folder:
        (folder / "call").write_bytes(ray.cloudpickle.dumps((function, arguments)))
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        program = "import sys; from mjsense.cluster import alone; alone.run_call(sys.argv[1])"
        done = subprocess.run(
            [sys.executable, "-X", "faulthandler", "-c", program, folder],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
        )
        result = folder / "result"
        if not result.exists():
            frame = re.search(r'^Current thread .*\n  File "(.*)", line (\d+) in (.*)$', done.stderr, re.MULTILINE)
            place = f"{frame[3]} in line {frame[2]} of {frame[1]}" if frame else ""
            return Outcome(None, Death(done.returncode, socket.gethostname(), place))
        value, error = pickle.loads(result.read_bytes())
    if error is not None:
        raise error
    return Outcome(value, None)


def run_call(folder: str) -> None:
    """Runs the call in the file ``call`` of a folder, and writes its result to the file ``result``."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)  # this process ends with the worker
    value, error = None, None
    try:
        function, arguments = pickle.loads((Path(folder) / "call").read_bytes())
        value = function(*arguments)
    except Exception as raised:
        error = raised
    try:
        content = pickle.dumps((value, error))
    except Exception:
        content = pickle.dumps((None, RuntimeError(f"{type(error or value).__name__}: {error or value}")))
    part = Path(folder) / "part"
    part.write_bytes(content)
    part.rename(Path(folder) / "result")
