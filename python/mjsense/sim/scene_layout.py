# SPDX-License-Identifier: Apache-2.0
"""Finds where the installed MuJoCo keeps the fields of its abstract scene.

``mjvGeom``, ``mjvLight`` and ``mjvGLCamera`` differ between versions of MuJoCo. Their layout is measured: each field is written
through MuJoCo's Python bindings, and the bytes of the struct that change are the field's place. Offsets are relative to the
struct's field ``pos``.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
from typing import Any

import numpy as np

Layout = dict[str, tuple[int, int]]
"""By field: offset from ``pos`` and size, in bytes."""


def address(array: np.ndarray) -> int:
    return array.__array_interface__["data"][0]


def _place(struct: Any, name: str, before: int, memory: ctypes.Array[ctypes.c_uint8]) -> tuple[int, int] | None:
    """The place of a number or text; `memory` starts `before` bytes before the struct's ``pos``."""

    def bytes_with(value: Any) -> np.ndarray:
        setattr(struct, name, value)
        return np.ctypeslib.as_array(memory).copy()

    old = getattr(struct, name)
    low, high = ("", "x") if isinstance(old, str) else (type(old)(0), type(old)(1))
    changed = np.flatnonzero(bytes_with(low) != bytes_with(high))
    size = 1
    if len(changed) and not isinstance(old, str):
        with contextlib.suppress(TypeError):  # an unsigned byte cannot be -1
            size = len(np.flatnonzero(bytes_with(low) != bytes_with(type(old)(-1))))
    setattr(struct, name, old)
    if not len(changed):
        return None
    first = int(changed[0])
    if isinstance(old, float):
        size, first = 4, first - (first - before) % 4  # the low bytes of 0 and 1 are equal
    return first - before, size


def _measure(structs: Any, index: int) -> Layout:
    """The layout of structs[index]; the memory of one struct before and after it must belong to the scene."""
    struct, neighbour = structs[index], structs[index - 1]
    stride = address(struct.pos) - address(neighbour.pos)
    memory = (ctypes.c_uint8 * (2 * stride)).from_address(address(struct.pos) - stride)
    layout: Layout = {}
    for name in dir(struct):
        if name.startswith("_"):
            continue
        if name == "label":
            struct.label = ""  # the scene's memory is not initialized, and reading it as text could fail
        value = getattr(struct, name)
        if isinstance(value, np.ndarray):
            layout[name] = (address(value) - address(struct.pos), value.nbytes)
        elif isinstance(value, (int, float, str)) and (place := _place(struct, name, stride, memory)):
            layout[name] = place
    return layout


@functools.cache
def layouts() -> dict[str, Layout]:
    """The layouts of geoms, lights and cameras in this process's MuJoCo."""
    import mujoco

    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    scene = mujoco.MjvScene(model, 3)
    return {"geom": _measure(scene.geoms, 1), "light": _measure(scene.lights, 1), "camera": _measure(scene.camera, 1)}
