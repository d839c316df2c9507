# SPDX-License-Identifier: Apache-2.0
"""Worlds of mjsense whose state and results are in the arrays of a ``mujoco_warp.Data``, and what may be done to these arrays."""

from __future__ import annotations

import dataclasses
import operator
import weakref
from typing import Any

import numpy as np
import warp as wp

from mjsense import _core
from mjsense.compat import _warp_rendering
from mjsense.core.counted import counted
from mjsense.core.mujoco_names import STATE
from mjsense.sim import foreign_model

_OTHER = ("qLD", "qLDiagInv", "qLU", "qH", "qHDiagInv")
"""Fields that have the names of fields of MuJoCo, with different contents."""

_OPTIONS = tuple(
    """
    integrator cone solver iterations ls_iterations noslip_iterations ccd_iterations sdf_initpoints sdf_iterations
    disableflags enableflags
    """.split()
)
"""Options that are Python numbers in mujoco_warp, and equal in MuJoCo. Older series lack some."""

_GEOMETRY = ("mesh_", "hfield_", "oct_", "tex_", "flex")
"""Beginnings of the names of the model's arrays that are large, and must not be changed."""

_CHECKED_BYTES = 1 << 16
"""Of the geometry, compared in each call with that of put_model(), in turn."""


class Worlds:
    """Worlds that are shown in the arrays of a ``mujoco_warp.Data``."""

    def __init__(self, model: Any, data: Any, source: Any, threads: int) -> None:
        """
        Args:
            source: The ``mujoco.MjModel`` that the model was made of.
            threads: Number of threads; 0: one per CPU.
        """
        self.model = model
        self._data = weakref.ref(data)
        self._check_sizes(source, data)
        try:
            ours = source if foreign_model.is_our_series(foreign_model.package_of(source)) else foreign_model.copy_of(source)
        except ValueError as error:
            raise ValueError(str(error).replace("attach()", "mujoco_warp on the CPU").replace("attached", "simulated")) from None
        self._arrays = _core.ForeignArrays(ours._address, data.nworld, threads)
        self.shown: list[str] = []
        """Fields of the data that show the worlds."""
        self.left: list[str] = []
        """Fields of the data that stay as they are."""
        self._num_worlds = data.nworld
        self._fixed = np.array(source.body_weldid)[source.geom_bodyid] == 0
        self._source = source
        self._options = {name: int(getattr(source.opt, name)) for name in _OPTIONS if hasattr(model.opt, name)}
        self._others: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        """Arrays of the model that MuJoCo does not have in this form, and their values at the last step."""
        self._geometry: dict[str, bytes] = {}
        """Arrays of the model that are large and must not be changed, as they were at first."""
        self._parts_of_geometry: list[tuple[str, memoryview, bytes]] = []
        self._next = 0
        self._set_options()
        self._link()

    @staticmethod
    def _check_sizes(source: Any, data: Any) -> None:
        for name, size in (
            ("qpos", source.nq),
            ("qvel", source.nv),
            ("ctrl", source.nu),
            ("xpos", source.nbody),
            ("geom_xpos", source.ngeom),
        ):
            found = getattr(data, name).shape
            if found[:2] != (data.nworld, size):
                raise ValueError(
                    f"this Data belongs to another model: its {name} has the shape {found[:2]}, "
                    f"and the model needs {(data.nworld, size)}"
                )

    def _link(self) -> None:
        """Tells the worlds where the arrays are."""
        data: Any = self._data()
        self._parts: list[tuple[dict[str, Any], tuple[Any, ...]]] = [({}, (None,))]  # an error leaves what no program has
        self._arrays.clear(data.naconmax, data.njmax)
        others: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self._parts_of_geometry = []
        self.shown, self.left = [], []
        self._linked: set[str] = set()
        parts = [("", "data", data), ("contact.", "contact", data.contact), ("efc.", "data", data.efc)]
        for prefix, kind, part in parts:
            self._check_arrays("data", prefix, part)
            for name in _array_fields(part):
                rows = part.worldid.shape[0] if kind == "contact" else data.nworld
                field = f"efc_{name}" if prefix == "efc." else name
                done = name not in _OTHER and self._add(kind, part, name, field, rows, not prefix and name in STATE)
                (self.shown if done else self.left).append(prefix + name)
        if self._add("contact", data, "nacon", "count", 1, False):
            self.left.remove("nacon")
            self.shown.append("nacon")
        for prefix, part in (("", self.model), ("opt.", self.model.opt)):
            self._check_arrays("model", prefix, part)
            hints = {field.name: field.type for field in dataclasses.fields(part)}
            for name in _array_fields(part):
                array = getattr(part, name)
                if name.startswith(_GEOMETRY):
                    self._keep_geometry(prefix + name, array)
                    continue
                by_world = getattr(hints[name], "shape", ("",))[:1] == ("*",)
                rows = array.shape[0] if by_world else 1
                if self._add("model", part, name, prefix + name, rows, False):
                    self._linked.add(name)
                elif by_world and array.size:
                    values = array.numpy()
                    known = self._others.get(prefix + name)
                    before = known[1] if known else self._first(prefix + name, values)
                    others[prefix + name] = values, np.resize(before, values.shape).astype(values.dtype)
        self._others = others
        # The attributes as they are now. They keep the arrays.
        self._parts = [
            (vars(part), (*vars(part).values(),)) for part in (data, data.contact, data.efc, self.model, self.model.opt)
        ]

    def _keep_geometry(self, name: str, array: Any) -> None:
        if not array.size or not array.device.is_cpu or not array.is_contiguous or array.dtype in (wp.uint64, wp.Texture2D):
            return
        now = np.ascontiguousarray(array.numpy()).data.cast("B")
        before = self._geometry.setdefault(name, bytes(now))
        if len(now) != len(before):
            raise ValueError(f"{name} cannot be changed after put_model(): it had {len(before)} bytes, and has {len(now)}")
        for first in range(0, len(now), _CHECKED_BYTES):
            part = slice(first, first + _CHECKED_BYTES)
            self._parts_of_geometry.append((name, now[part], before[part]))

    def _check_geometry(self) -> None:
        """Compares the next part of the geometry with what it was."""
        compared = 0
        for _ in self._parts_of_geometry:
            self._next = (self._next + 1) % len(self._parts_of_geometry)
            name, now, before = self._parts_of_geometry[self._next]
            if now.tobytes() != before:
                raise ValueError(f"{name} cannot be changed after put_model(): make the model anew")
            compared += len(now)
            if compared >= _CHECKED_BYTES:
                break

    def _size(self, name: str) -> int | None:
        """A size of the data or the model, for example nq; None if there is no such one."""
        return getattr(self._data(), name, getattr(self.model, name, None))

    def _check_arrays(self, owner: str, prefix: str, part: Any) -> None:
        """Raises ValueError if a program has replaced an array by one of another size or type."""
        for field in dataclasses.fields(part):
            array: Any = getattr(part, field.name)
            wanted: Any = field.type
            if not isinstance(array, wp.array) or not isinstance(getattr(wanted, "shape", None), tuple):
                continue
            if prefix + field.name in ("efc.J", *_OTHER):  # which are not written, and have several forms
                continue
            rows = owner == "model" and wanted.shape[:1] == ("*",) and array.shape[0] == 0 and all(array.shape[1:])
            if not array.size and field.name not in STATE and not rows:
                continue  # mujoco_warp does not allocate what the model does not need
            named = [size if isinstance(size, int) else self._size(size) for size in wanted.shape]
            same = len(named) == array.ndim and all(size is None or size == n for size, n in zip(named, array.shape))
            if not same or rows:
                shape = tuple("*" if size is None else size for size in named)
                raise ValueError(f"{prefix}{field.name} of the {owner} has the shape {array.shape}, expected {shape}")
            if _elements(array.dtype) != _elements(wanted.dtype):
                found, expected = array.dtype.__name__, wanted.dtype.__name__
                raise ValueError(f"{prefix}{field.name} of the {owner} has elements of {found}, expected {expected}")

    def _add(self, kind: str, part: Any, name: str, field: str, rows: int, state: bool) -> bool:
        array = getattr(part, name)
        if not array.device.is_cpu:
            raise ValueError(f"{name} is on the device {array.device}, and other arrays of the data are on the CPU")
        if not array.size:
            return True
        values = array.numpy()
        if not values.flags.c_contiguous:
            raise ValueError(f"{name} is not contiguous in memory: strides {values.strides} of the shape {values.shape}")
        if values.dtype.name not in ("float32", "int32", "bool") or values.size % rows:
            return False
        return self._arrays.add(kind, field, array.ptr, values.dtype.name, rows, values.size // rows, state)

    def run(self, call: int, mask: int = 0) -> None:
        """Calls MuJoCo's function for all worlds. `mask`: address of an array of bools; of a reset."""
        self._update()
        self._arrays.run(call, mask)

    def set_constants(self, fields: tuple[str, ...], restore: bool) -> bool:
        """Derives these fields of the model; False if one of them is not linked."""
        self._update()
        if not self._linked.issuperset(fields):
            return False
        self._arrays.set_constants([*fields], restore)
        return True

    def render(self, rc: Any) -> None:
        """Draws the images of the render context."""
        for name in ("rgb_data", "depth_data", "seg_data"):
            array = getattr(rc, name)
            if array.shape[0] != self._num_worlds or not array.device.is_cpu or (array.size and not array.is_contiguous):
                raise ValueError(
                    f"render(): {name} of the render context is for {counted(array.shape[0], 'world')} on "
                    f"{array.device}, and the data has "
                    f"{self._num_worlds} on the CPU: make the context with nworld={self._num_worlds}"
                )
        self._update()
        rc.seg_data.numpy()[...] = -1
        groups = sum(1 << group for group in _warp_rendering.geom_groups(self._source, rc))
        settings = (bool(rc.use_textures), bool(rc.use_shadows), bool(rc.render_skybox), int(rc.background_color))
        settings += _warp_rendering.look_of(rc)
        cameras = _warp_rendering.cameras_of(rc)
        if cameras:
            self._arrays.render(cameras, _warp_rendering.row_lengths(rc), groups, *settings)

    def _update(self) -> None:
        """Takes over arrays and options that the program has replaced."""
        for attributes, values in self._parts:
            if len(attributes) != len(values) or not all(map(operator.is_, attributes.values(), values)):
                self._set_options()
                self._link()
                break
        self._check_geometry()
        for name, (now, before) in self._others.items():
            if now.tobytes() != before.tobytes():
                self._changed(name, now)
                before[...] = now

    def cast(self, query: dict[str, Any]) -> None:
        """Casts the rays of a call of ``mujoco_warp.rays``."""
        count = query["pnt"].shape[1]
        kinds = {
            "pnt": wp.vec3,
            "vec": wp.vec3,
            "bodyexclude": wp.int32,
            "dist": wp.float32,
            "geomid": wp.int32,
            "normal": wp.vec3,
        }
        for name, kind in kinds.items():
            array, shape = query[name], (count,) if name == "bodyexclude" else (self._num_worlds, count)
            if name in ("pnt", "vec") and array.shape == (1, count) != shape:  # the same rays in all worlds
                array = query[name] = wp.array(np.repeat(array.numpy(), self._num_worlds, axis=0), dtype=kind, device="cpu")
            if array.dtype is not kind or array.shape != shape or not array.is_contiguous or not array.device.is_cpu:
                raise ValueError(
                    f"rays(): {name} must be a contiguous array {shape} of {kind.__name__} on the CPU, "
                    f"not {array.shape} of {array.dtype.__name__} on {array.device}"
                )
        hidden = np.zeros(self.model.ngeom, np.uint8)
        if query["rc"] is not None:
            hidden[:] = 1
            hidden[query["rc"].enabled_geom_ids.numpy()] = 0
        if not query["flg_static"]:
            hidden[self._fixed] = 1
        wanted = [*query["geomgroup"]]
        groups = sum((group != 0) << bit for bit, group in enumerate(wanted))
        if count:
            self._arrays.cast(count, [query[name].ptr for name in kinds], groups, hidden.tobytes())

    def _set_options(self) -> None:
        for name, before in self._options.items():
            value = int(getattr(self.model.opt, name))
            if value != before:
                self._arrays.set_option(f"opt.{name}", [value])
                self._options[name] = value

    def _first(self, name: str, now: np.ndarray) -> Any:
        """The values of this array in the model that `put_model` was called with, if it has them."""
        if name == "opt.impratio_invsqrt":
            return 1 / np.sqrt(max(self._source.opt.impratio, 1e-15))
        values = getattr(self._source, name, now)
        return values if values.size == now[0].size else now

    def _changed(self, name: str, now: np.ndarray) -> None:
        if name != "opt.impratio_invsqrt":
            raise ValueError(f"{name} cannot be changed after put_model()")
        self._arrays.set_option("opt.impratio", (now.astype(float) ** -2).tolist())


def _elements(dtype: Any) -> tuple[Any, int]:
    """The kind of the numbers of a Warp type, and the bytes of an element."""
    kind = getattr(dtype, "_wp_scalar_type_", dtype)
    return {bool: wp.bool, int: wp.int32, float: wp.float32}.get(kind, kind), wp.types.type_size_in_bytes(dtype)


def _array_fields(part: Any) -> list[str]:
    return [field.name for field in dataclasses.fields(part) if isinstance(getattr(part, field.name), wp.array)]
