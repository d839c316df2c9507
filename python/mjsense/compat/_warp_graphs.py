# SPDX-License-Identifier: Apache-2.0
"""Calls of functions of this process in graphs of Warp.

Warp records kernels while a graph is captured on the CPU, and runs them when it is launched. A kernel that calls a function of
this process has its place among them.
"""

from __future__ import annotations

import ctypes
import functools
import weakref
from collections.abc import Callable
from typing import Any

import warp as wp

capture_launch = wp.capture_launch
"""Warp's own function."""


@wp.func_native("((void (*)(long long))function)(argument);")
def _call_back(function: wp.int64, argument: wp.int64) -> None: ...


@wp.kernel(enable_backward=False, module="unique")
def _recorded(function: wp.int64, argument: wp.int64) -> None:
    _call_back(function, argument)


_in_graphs: dict[int, Callable[[], None]] = {}
"""Calls that graphs contain, by their number."""
_failed: list[BaseException] = []
"""Errors of calls in the graph that is being launched."""


@ctypes.CFUNCTYPE(None, ctypes.c_longlong)
def _run_recorded(number: int) -> None:
    if not _failed:  # the graph cannot be stopped
        try:
            _in_graphs[number]()
        except BaseException as error:
            _failed.append(error)


def call_or_record(call: Callable[[], None]) -> None:
    """Calls this now, or, while a graph is captured, whenever the graph is launched."""
    device: Any = wp.get_device("cpu")
    if not device.is_capturing:
        return call()
    number = id(call)
    _in_graphs[number] = call
    weakref.finalize(wp._src.context.runtime._apic_graph, _in_graphs.pop, number, None)
    wp.launch(_recorded, dim=1, inputs=[ctypes.cast(_run_recorded, ctypes.c_void_p).value, number], device="cpu")


@functools.wraps(capture_launch)
def launch_graph(graph: Any, stream: Any = None) -> None:
    capture_launch(graph, stream)
    if _failed:
        raise _failed.pop()
