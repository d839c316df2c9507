# SPDX-License-Identifier: Apache-2.0
"""Ray: the connection to a cluster, and a function that runs as stateless tasks there."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from typing import Any


def _ray() -> Any:
    try:
        import ray  # pyright: ignore[reportMissingImports]
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(f"A cluster needs Ray: pip install 'mjsense[ray]' ({error})", name=error.name) from error
    return ray


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
        ray.init(**options, include_dashboard=False) if address == "local" else ray.init(address=address, **options)
    try:
        yield ray
    finally:
        if started_here:
            ray.shutdown()


class Tasks:
    """Calls of one function as tasks of one CPU each, at most one more than the cluster has CPUs, so that no worker waits for the driver.

    A task that is lost with its worker is repeated; an exception of the function is raised here.
    """

    def __init__(self, ray: Any, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]) -> None:
        self._ray, self._waiting = ray, iter(arguments)
        self._task = ray.remote(num_cpus=1, max_retries=-1)(function)
        self._running: dict[Any, tuple[Any, ...]] = {}

    @property
    def count(self) -> int:
        """Number of tasks that are running or about to."""
        return len(self._running)

    def _start(self) -> None:
        slots = max(1, int(self._ray.cluster_resources().get("CPU", 1)))
        while len(self._running) <= slots and (arguments := next(self._waiting, None)) is not None:
            self._running[self._task.remote(*arguments)] = arguments

    def wait(self) -> list[tuple[tuple[Any, ...], Any]]:
        """Arguments and results of the tasks that have ended, after at most a second. Ended tasks are replaced by new ones first."""
        self._start()
        done = self._ray.wait(list(self._running), timeout=1.0)[0] if self._running else []
        found = [(self._running.pop(ref), self.result(ref)) for ref in done]
        self._start()
        return found

    def result(self, ref: Any) -> Any:
        try:
            return self._ray.get(ref)
        except self._ray.exceptions.RayTaskError as error:
            raise (error.cause if isinstance(error.cause, Exception) else error) from None

    def cancel(self) -> None:
        for ref in self._running:
            self._ray.cancel(ref, force=True)


@contextlib.contextmanager
def running(ray: Any, function: Callable[..., Any], arguments: Iterable[tuple[Any, ...]]) -> Iterator[Tasks]:
    """Tasks, of which those that have not ended are cancelled at the end of the block."""
    tasks = Tasks(ray, function, arguments)
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
            raise TypeError(f"{context}: {name} cannot be sent to the workers: {error}. Pass the class or a function that creates it") from error
