# SPDX-License-Identifier: Apache-2.0
"""Programs that use mujoco_warp, with the physics of mjsense on the CPU.

    mjsense.compat.mujoco_warp.use()
    model = mujoco_warp.put_model(mj_model)
    data = mujoco_warp.put_data(mj_model, mj_data, nworld=1024)
    mujoco_warp.step(model, data)

``step``, ``forward``, ``step1``, ``step2``, ``reset_data``, ``set_const``, ``rays`` and ``render`` then compute all worlds with
MuJoCo and mjsense, on all cores, if the arrays are on Warp's CPU device, and write the results into the arrays of the data, the
model or the render context. On CUDA devices, and for models with callbacks or with ``opt.run_collision_detection=False``, they
are mujoco_warp's own. All other functions are mujoco_warp's own everywhere, and read these arrays.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import functools
import importlib.metadata
import inspect
import operator
import sys
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.compat import _warp_rendering
from mjsense.sim import foreign_model
from mjsense.sim.attached import _STATE

try:
    import mujoco_warp
    import warp as wp
except ImportError as error:
    raise ImportError(f"mjsense.compat.mujoco_warp needs the package mujoco-warp, and {error}: pip install mujoco-warp") from None

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

_TESTED = ("3.11", "4.0")
"""The first and last series of mujoco_warp that this is tested with."""

_CALLS = {"step": 0, "forward": 1, "step1": 2, "step2": 3}
_RESET = 4
_CONSTANTS = ("set_const", "set_const_0", "set_const_fixed")
_OTHERS = ("reset_data", "ray", "rays", "refit_bvh", "render", "put_model")
_OWN = {name: getattr(mujoco_warp, name) for name in (*_CALLS, *_CONSTANTS, *_OTHERS) if hasattr(mujoco_warp, name)}
"""mujoco_warp's own functions. Older and newer series lack some."""
_capture_launch = wp.capture_launch

_OTHER = ("qLD", "qLDiagInv", "qLU", "qH", "qHDiagInv")
"""Fields that have the names of fields of MuJoCo, with different contents."""

_OPTIONS = (
    "integrator",
    "cone",
    "solver",
    "iterations",
    "ls_iterations",
    "noslip_iterations",
    "ccd_iterations",
    "sdf_initpoints",
    "sdf_iterations",
    "disableflags",
    "enableflags",
)
"""Options that are Python numbers in mujoco_warp, and equal in MuJoCo. Older series lack some."""

_GEOMETRY = ("mesh_", "hfield_", "oct_", "tex_", "flex")
"""Beginnings of the names of the model's arrays that are large, and must not be changed."""

_FIXED = ("body_subtreemass",)
_BOUNDS = ("geom_aabb", "geom_rbound", "geom_size")  # of mujoco_warp 4.0
_KINEMATICS = (
    "tendon_length0",
    "eq_data",
    *("cam_pos0", "cam_poscom0", "cam_mat0"),
    *("light_pos0", "light_poscom0", "light_dir0"),
)
_INERTIA = ("dof_invweight0", "body_invweight0", "tendon_invweight0", "actuator_acc0")
"""What mujoco_warp's ``set_const`` derives."""

_CHECKED_BYTES = 1 << 16
"""Of the geometry, compared in each call with that of put_model(), in turn."""

_models: dict[int, Any] = {}
"""By the id of a ``mujoco_warp.Model``: a copy of the ``mujoco.MjModel`` that it was made of."""
_worlds: dict[int, Worlds] = {}
"""By the id of a ``mujoco_warp.Data``."""
_threads = 0


def use(threads: int = 0) -> None:
    """From now on, mujoco_warp steps worlds on the CPU with mjsense. Call it before ``mujoco_warp.put_model``.

    Modules that have imported the functions themselves use the new ones, too.

    Args:
        threads: Number of threads; 0: one per CPU that is available to this process.

    Raises:
        ImportError: If the installed mujoco_warp is of a series that was not tested.
    """
    global _threads
    version = importlib.metadata.version("mujoco-warp")
    first, series, last = (tuple(map(int, text.split(".")[:2])) for text in (_TESTED[0], version, _TESTED[1]))
    if not first <= series <= last:
        raise ImportError(
            f"mjsense.compat.mujoco_warp is tested with mujoco-warp {' to '.join(_TESTED)}, and {version} is installed"
        )
    _threads = threads
    _replace({_OWN[name]: new for name, new in _NEW.items()} | {_capture_launch: _launch_graph})


def stop() -> None:
    """From now on, all functions are mujoco_warp's own again."""
    _replace({new: _OWN[name] for name, new in _NEW.items()} | {_launch_graph: _capture_launch})


@contextlib.contextmanager
def used(threads: int = 0) -> Iterator[None]:
    """``use()`` for a ``with`` block, and ``stop()`` at its end."""
    use(threads)
    try:
        yield
    finally:
        stop()


def _replace(functions: dict[Any, Any]) -> None:
    """Replaces functions in all modules, except in mujoco_warp's own files."""
    by_id = {id(old): new for old, new in functions.items()}
    for name, module in [*sys.modules.items()]:
        if name.startswith("mujoco_warp._src") or name == __name__:
            continue
        for attribute, value in [*getattr(module, "__dict__", {}).items()]:
            if id(value) in by_id:
                setattr(module, attribute, by_id[id(value)])


def worlds_of(model: Any, data: Any) -> Worlds:
    """The worlds of this model and data, which are made at the first step."""
    worlds = _worlds.get(id(data))
    if worlds is None or worlds.model is not model:
        if worlds is None:
            weakref.finalize(data, _worlds.pop, id(data), None)
        worlds = _worlds[id(data)] = Worlds(model, data)
    return worlds


class Worlds:
    """Worlds that are shown in the arrays of a ``mujoco_warp.Data``."""

    def __init__(self, model: Any, data: Any) -> None:
        if id(model) not in _models:
            raise ValueError(
                "mjsense.compat.mujoco_warp does not know what this Model was made of: call use() before mujoco_warp.put_model()"
            )
        self.model = model
        self._data = weakref.ref(data)
        source = _models[id(model)]
        self._check_sizes(source, data)
        try:
            ours = source if foreign_model.is_our_series(foreign_model.package_of(source)) else foreign_model.copy_of(source)
        except ValueError as error:
            raise ValueError(str(error).replace("attach()", "mujoco_warp on the CPU").replace("attached", "simulated")) from None
        self._arrays = _core.ForeignArrays(ours._address, data.nworld, _threads)
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
                done = name not in _OTHER and self._add(kind, part, name, field, rows, not prefix and name in _STATE)
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
            if not array.size and field.name not in _STATE and not rows:
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
                    f"render(): {name} of the render context is for {array.shape[0]} worlds on {array.device}, and the data has "
                    f"{self._num_worlds} on the CPU: make the context with nworld={self._num_worlds}"
                )
        self._update()
        rc.seg_data.numpy()[...] = -1
        groups = sum(1 << group for group in _warp_rendering.geom_groups(self._source, rc))
        settings = (bool(rc.use_textures), bool(rc.use_shadows), bool(rc.render_skybox), int(rc.background_color))
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


def _on_cpu(model: Any, data: Any) -> bool:
    own = any(vars(model.callback).values()) or not model.opt.run_collision_detection
    return data.qpos.device.is_cpu and not own


def _call(name: str) -> Callable[[Any, Any], None]:
    own, number = _OWN[name], _CALLS[name]

    @functools.wraps(own)
    def call(m: Any, d: Any) -> None:
        if _on_cpu(m, d):
            _do(lambda: worlds_of(m, d).run(number))
        else:
            own(m, d)

    return call


# Graphs. Warp records kernels while a graph is captured on the CPU, and runs them when it is launched. A kernel that calls a
# function of this process has its place among them.


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


def _do(call: Callable[[], None]) -> None:
    """Calls this now, or, while a graph is captured, whenever the graph is launched."""
    device: Any = wp.get_device("cpu")
    if not device.is_capturing:
        return call()
    number = id(call)
    _in_graphs[number] = call
    weakref.finalize(wp._src.context.runtime._apic_graph, _in_graphs.pop, number, None)
    wp.launch(_recorded, dim=1, inputs=[ctypes.cast(_run_recorded, ctypes.c_void_p).value, number], device="cpu")


@functools.wraps(_capture_launch)
def _launch_graph(graph: Any, stream: Any = None) -> None:
    _capture_launch(graph, stream)
    if _failed:
        raise _failed.pop()


@functools.wraps(_OWN["reset_data"])
def _reset_data(m: Any, d: Any, reset: Any = None) -> None:
    if not _on_cpu(m, d):
        return _OWN["reset_data"](m, d, reset)
    if reset is None:
        return _do(lambda: worlds_of(m, d).run(_RESET))
    if reset.shape != (d.nworld,) or not (reset.dtype is wp.bool or wp.types.type_is_int(reset.dtype)) or not reset.device.is_cpu:
        raise ValueError(
            f"reset_data(): reset must be an array of {d.nworld} bools or integers on the CPU, "
            f"not {reset.dtype.__name__} {reset.shape} on {reset.device}"
        )

    def run() -> None:
        mask = np.ascontiguousarray(reset.numpy() != 0)
        worlds_of(m, d).run(_RESET, mask.ctypes.data)

    return _do(run)


def _casts(model: Any, data: Any) -> bool:
    """Whether the rays of this data are cast by its worlds, which need no hierarchy of bounding volumes."""
    worlds = _worlds.get(id(data))
    return worlds is not None and worlds.model is model and not model.nflex and _on_cpu(model, data)


_rays_arguments = inspect.signature(_OWN["rays"])


@functools.wraps(_OWN["rays"])
def _rays(*args: Any, **kwargs: Any) -> None:
    query = _rays_arguments.bind(*args, **kwargs)
    query.apply_defaults()
    model, data = query.arguments["m"], query.arguments["d"]
    if _casts(model, data):
        _do(lambda: _worlds[id(data)].cast(dict(query.arguments)))
    else:
        if query.arguments["rc"] is not None:
            _OWN["refit_bvh"](model, data, query.arguments["rc"])  # which _refit_bvh() may not have done
        _OWN["rays"](*args, **kwargs)


@functools.wraps(_OWN["ray"])
def _ray(*args: Any, **kwargs: Any) -> Any:
    call = inspect.signature(_OWN["ray"]).bind(*args, **kwargs).arguments
    if call.get("rc") is not None and _needs_no_bvh(call["m"], call["d"], call["rc"]):
        _OWN["refit_bvh"](call["m"], call["d"], call["rc"])  # which _refit_bvh() has not done
    return _OWN["ray"](*args, **kwargs)


@functools.wraps(_OWN["refit_bvh"])
def _refit_bvh(m: Any, d: Any, rc: Any) -> None:
    if not _needs_no_bvh(m, d, rc):
        _OWN["refit_bvh"](m, d, rc)


def _needs_no_bvh(model: Any, data: Any, rc: Any) -> bool:
    return _draws(model, data, rc) if rc.nrender else _casts(model, data)


_drawn: dict[int, bool] = {}
"""By the id of a render context: whether mjsense draws it."""


def _draws(model: Any, data: Any, rc: Any) -> bool:
    """Whether the images of this render context are mjsense's."""
    if not _on_cpu(model, data) or id(model) not in _models:
        return False
    known = _drawn.get(id(rc))
    if known is None:
        weakref.finalize(rc, _drawn.pop, id(rc), None)
        known = _drawn[id(rc)] = not _warp_rendering.reason_to_leave(model, _models[id(model)], rc)
    return known


@functools.wraps(_OWN["render"])
def _render(m: Any, d: Any, rc: Any) -> None:
    if _draws(m, d, rc):
        _do(lambda: worlds_of(m, d).render(rc))
    else:
        _OWN["render"](m, d, rc)


def _set_const(name: str) -> Callable[..., None]:
    own = _OWN[name]
    arguments = inspect.signature(own)

    @functools.wraps(own)
    def call(*args: Any, **kwargs: Any) -> None:
        given = arguments.bind(*args, **kwargs)
        given.apply_defaults()
        model, data = given.arguments["m"], given.arguments["d"]
        fields = _fields(name, given.arguments.get("groups"))
        fields = tuple(field for field in fields if getattr(model, field).size)
        if not _on_cpu(model, data) or id(model) not in _models or _has_placeholders(name, model):
            return own(*args, **kwargs)

        def run() -> None:
            if not worlds_of(model, data).set_constants(fields, given.arguments.get("restore", False)):
                own(*args, **kwargs)

        _do(run)

    return call


def _fields(name: str, groups: int | None) -> tuple[str, ...]:
    """What this function of mujoco_warp derives; `groups` of its version 4.0."""
    if groups is not None:  # SetConstGroup
        parts = ((1, (*_FIXED, *_BOUNDS)), (2, _KINEMATICS), (4, _INERTIA))
        return tuple(field for bit, part in parts if groups & bit for field in part)
    bounds = _BOUNDS if hasattr(mujoco_warp, "SetConstGroup") else ()
    fixed, zero = (*_FIXED, *bounds), (*_KINEMATICS, *_INERTIA)
    return {"set_const_fixed": fixed, "set_const_0": zero}.get(name, (*fixed, *zero))


def _has_placeholders(name: str, model: Any) -> bool:
    """Whether an actuator has a damping ratio, or a tendon no spring length, which mujoco_warp's function would replace."""
    if hasattr(mujoco_warp, "SetConstGroup"):
        return False
    ratio = model.actuator_biasprm.size and (model.actuator_biasprm.numpy()[..., 2] > 0).any()
    springs = name == "set_const" and model.tendon_lengthspring.size and (model.tendon_lengthspring.numpy() < 0).any()
    return bool(name != "set_const_fixed" and (ratio or springs))


@functools.wraps(_OWN["put_model"])
def _put_model(mjm: Any, *args: Any, **kwargs: Any) -> Any:
    model = _OWN["put_model"](mjm, *args, **kwargs)
    if model.qpos0.device.is_cpu:
        weakref.finalize(model, _models.pop, id(model), None)
        _models[id(model)] = mjm.__copy__()
    return model


_NEW = {
    **{name: _call(name) for name in _CALLS},
    **{name: _set_const(name) for name in _CONSTANTS if name in _OWN},
    "reset_data": _reset_data,
    "render": _render,
    "ray": _ray,
    "rays": _rays,
    "refit_bvh": _refit_bvh,
    "put_model": _put_model,
}
