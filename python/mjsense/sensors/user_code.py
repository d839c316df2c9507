# SPDX-License-Identifier: Apache-2.0
"""Calls the code of user-defined sensors with the arguments that it takes, with reproducible random numbers and with errors that
name it."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np


class SensorError(RuntimeError):
    """Code of a sensor written in Python failed, or its value is not as declared; ``__cause__`` is the original exception."""


@functools.lru_cache(maxsize=1024)
def _parameters_of(function: Any) -> tuple[inspect.Parameter, ...]:
    try:
        return tuple(inspect.signature(function).parameters.values())
    except (TypeError, ValueError):
        return ()


def parameters(function: Any) -> tuple[inspect.Parameter, ...]:
    """The parameters that a call must pass, without self."""
    return _parameters_of(function.__func__)[1:] if inspect.ismethod(function) else _parameters_of(function)


def required(function: Any) -> list[inspect.Parameter]:
    """Positional parameters without a default."""
    return [p for p in parameters(function) if p.default is p.empty and p.kind < 2]


def takes(function: Any, count: int) -> bool:
    """Whether it has at least `count` positional parameters."""
    return len([p for p in parameters(function) if p.kind < 2]) >= count


_RANDOM: Any = np.random  # its type stubs lack get_bit_generator() and set_bit_generator()


class RandomStreams:
    """Replaces NumPy's global random numbers while sensors are computed. Each world and time has its own stream, which does not
    depend on the world's id or on the other worlds. The program's random state is restored afterwards."""

    _own: ClassVar[list[Any]] = []  # one generator per nesting level, because a sensor may read another one
    _depth: ClassVar[int] = 0

    def __init__(self, seeds: Sequence[int], world_ids: Sequence[int], occasion: int) -> None:
        self._seeds = {world: (seed + occasion) % 2**32 for world, seed in zip(world_ids, seeds)}
        self._before: Any = None

    def __enter__(self) -> RandomStreams:
        if self._seeds:
            if RandomStreams._depth == len(self._own):
                self._own.append(np.random.MT19937(0))
            self._before = _RANDOM.get_bit_generator()
            _RANDOM.set_bit_generator(self._own[RandomStreams._depth])
            RandomStreams._depth += 1
        return self

    def seed(self, world: int) -> None:
        if self._seeds:
            np.random.seed(self._seeds[world])

    def __exit__(self, *exception: object) -> None:
        if self._seeds:
            RandomStreams._depth -= 1
            _RANDOM.set_bit_generator(self._before)


class named:
    """Adds the sensor, world and method to errors of user code and keeps the traceback."""

    def __init__(self, uuid: str, method: str, world: int | None = None) -> None:
        world_text = "" if world is None else f", world {world}"
        self.context = f"sensor '{uuid}'{world_text}: {method}()"

    def __enter__(self) -> None: ...

    def __exit__(self, kind: Any, error: BaseException | None, traceback: Any) -> None:
        if isinstance(error, Exception):
            raise SensorError(f"{self.context}: {kind.__name__}: {error}") from error
