# SPDX-License-Identifier: Apache-2.0
"""Ray: the connection to a cluster, and a function that runs as stateless tasks there."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from mjsense.cluster.alone import Death, alone
from mjsense.core.optional import optional

_CRASHES = 2  # deaths of workers after which a task runs in a process of its own
_DEATHS = 2  # deaths of that process by a defect, after which it is not repeated


def _ray() -> Any:
    return optional("ray", "ray", "A cluster")


@contextlib.contextmanager
def cluster(address: str, runtime_env: dict[str, Any] | None = None) -> Iterator[Any]:
    """The module ``ray``, connected to a cluster. A connection that was made here ends with the block.

    Args:
        address: ``local`` for a cluster of this machine's CPUs that ends with the block, ``auto``, or the address of a cluster.
        runtime_env: Ray's runtime environment: ``working_dir``, ``pip`` and so on.
    """
    ray = _ray()
    started_here = not ray.is_initialized()
    if started_here:
        options: dict[str, Any] = {"log_to_driver": False, "runtime_env": runtime_env, "logging_level": "ERROR"}
        ray.init(address=address, **options, **({"include_dashboard": False} if address == "local" else {}))
    try:
        yield ray
    finally:
        if started_here:
            ray.shutdown()


class Tasks:
    """Calls of one function as tasks of one CPU each, at most one more than the cluster has CPUs, so that no worker waits for the
    driver.

    A task that is lost with its worker or machine is repeated; an exception of the function is raised here. A task whose process
    has died twice is repeated in a process of its own (``alone``), which tells how it ended. If that is a defect, such as
    SIGSEGV, twice, this is an error.
    """

    def __init__(
        self, ray: Any, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]], describe: Callable[..., str]
    ) -> None:
        self._ray, self._function, self._describe, self._waiting = ray, function, describe, iter(arguments)
        self._running: dict[Any, _Call] = {}
        self._crashed = (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError)
        self._lost = (
            *self._crashed,
            ray.exceptions.NodeDiedError,
            ray.exceptions.LocalRayletDiedError,
            ray.exceptions.ObjectLostError,
        )

    @property
    def count(self) -> int:
        """Number of tasks that are running or about to."""
        return len(self._running)

    def __iter__(self) -> Iterator[tuple[tuple[Any, ...], Any]]:
        """Arguments and results of all tasks, as they end."""
        while (ended := self.wait()) or self.count:
            yield from ended

    def wait(self) -> list[tuple[tuple[Any, ...], Any]]:
        """Arguments and results of the tasks that have ended, after at most a second. Ended tasks are replaced by new ones
        first."""
        self._start_new()
        done = self._ray.wait(list(self._running), timeout=1.0)[0] if self._running else []
        found = [
            (call.arguments, result) for ref in done for call in [self._running.pop(ref)] for result in self._result(ref, call)
        ]
        self._start_new()
        return found

    def cancel(self) -> None:
        for ref in self._running:
            self._ray.cancel(ref, force=True)

    def _start_new(self) -> None:
        slots = max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        while len(self._running) <= slots and (arguments := next(self._waiting, None)) is not None:
            self._start(_Call(arguments))

    def _start(self, call: _Call) -> None:
        options: dict[str, Any] = {"num_cpus": 1, "max_retries": 0, "name": self._function.__name__}
        if call.alone:
            # On different machines, if there are several: one of them may be the reason.
            ref = self._ray.remote(scheduling_strategy="SPREAD", **options)(alone).remote(self._function, call.arguments)
        else:
            ref = self._ray.remote(**options)(self._function).remote(*call.arguments)
        self._running[ref] = call

    def _result(self, ref: Any, call: _Call) -> Iterator[Any]:
        """The result of a task that has ended; nothing if it is started again."""
        try:
            result = self._ray.get(ref)
        except self._ray.exceptions.RayTaskError as error:
            if isinstance(error.cause, self._ray.exceptions.RaySystemError):
                reason = str(error.cause).splitlines()[0].removeprefix("System error: ")
                raise RuntimeError(
                    f"The workers cannot load the arguments of the task {self._function.__name__}: {reason}. Send "
                    "its folder with "
                    "working_dir (--ray-working-dir), or install its package with pip (--ray-pip)"
                ) from None
            raise (error.cause if isinstance(error.cause, Exception) else error) from None
        except self._ray.exceptions.RuntimeEnvSetupError as error:
            lines = [line.strip() for line in str(error).splitlines() if line.strip()]
            reason = next((line for line in reversed(lines) if line.startswith("ERROR: ")), lines[-1])
            raise RuntimeError(f"Ray cannot make the environment of the workers (runtime_env): {reason}") from None
        except self._lost as error:
            call.crashes += isinstance(error, self._crashed)
            self._start(call)
            return
        if not call.alone:
            yield result
        elif result.death is None:
            yield result.value
        elif result.death.from_outside:
            self._start(call)
        else:
            call.deaths.append(result.death)
            if len(call.deaths) == _DEATHS:
                raise RuntimeError(self._defect(call))
            self._start(call)

    def _defect(self, call: _Call) -> str:
        """The message about a call that ends its process."""
        count, last = call.crashes + len(call.deaths), call.deaths[-1]
        machines = ", ".join(dict.fromkeys(death.machine for death in call.deaths))
        text = (
            f"{self._describe(*call.arguments)} ended its process {count} times, the last time with {last.how}, on {machines}. "
        )
        text += "Probably user-defined code, or a library that it calls, has a defect" + (f": {last.place}" if last.place else "")
        return text


@dataclass
class _Call:
    """A call and how often it failed."""

    arguments: tuple[Any, ...]
    crashes: int = 0
    """Number of times that a worker died, for an unknown reason."""
    deaths: list[Death] = field(default_factory=list)
    """Deaths of processes of its own."""

    @property
    def alone(self) -> bool:
        """Whether it runs in a process of its own."""
        return self.crashes >= _CRASHES


@contextlib.contextmanager
def running(
    ray: Any, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]], describe: Callable[..., str]
) -> Iterator[Tasks]:
    """Tasks, of which those that have not ended are cancelled at the end of the block.

    Args:
        describe: Names a call with these arguments in a message: "The export of the episodes 0 to 15".
    """
    tasks = Tasks(ray, function, arguments, describe)
    try:
        yield tasks
    finally:
        tasks.cancel()


def check_pickle(context: str, arguments: dict[str, Any] | None) -> None:
    """Raises TypeError that names the argument which cannot be sent to workers."""
    dumps = _ray().cloudpickle.dumps
    for name, value in (arguments or {}).items():
        try:
            dumps(value)
        except Exception as error:
            raise TypeError(
                f"{context}: {name} cannot be sent to the workers: {error}. Pass the class or a function that creates it"
            ) from error
