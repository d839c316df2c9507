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
import functools
import importlib.metadata
import inspect
import sys
import weakref
from typing import TYPE_CHECKING, Any

import numpy as np

try:
    import mujoco_warp
    import warp as wp
except ImportError as error:
    raise ImportError(f"mjsense.compat.mujoco_warp needs the package mujoco-warp, and {error}: pip install mujoco-warp") from None

from mjsense.compat import _warp_rendering
from mjsense.compat._warp_constants import fields_of, has_placeholders
from mjsense.compat._warp_graphs import call_or_record, capture_launch, launch_graph
from mjsense.compat._warp_worlds import Worlds

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
    _replace({_OWN[name]: new for name, new in _NEW.items()} | {capture_launch: launch_graph})


def stop() -> None:
    """From now on, all functions are mujoco_warp's own again."""
    _replace({new: _OWN[name] for name, new in _NEW.items()} | {launch_graph: capture_launch})


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
        if name.startswith(("mujoco_warp._src", "mjsense.compat._warp_")) or name == __name__:
            continue
        for attribute, value in [*getattr(module, "__dict__", {}).items()]:
            if id(value) in by_id:
                setattr(module, attribute, by_id[id(value)])


def worlds_of(model: Any, data: Any) -> Worlds:
    """The worlds of this model and data, which are made at the first step."""
    worlds = _worlds.get(id(data))
    if worlds is None or worlds.model is not model:
        if id(model) not in _models:
            raise ValueError(
                "mjsense.compat.mujoco_warp does not know what this Model was made of: call use() before mujoco_warp.put_model()"
            )
        if worlds is None:
            weakref.finalize(data, _worlds.pop, id(data), None)
        worlds = _worlds[id(data)] = Worlds(model, data, _models[id(model)], _threads)
    return worlds


def _on_cpu(model: Any, data: Any) -> bool:
    own = any(vars(model.callback).values()) or not model.opt.run_collision_detection
    return data.qpos.device.is_cpu and not own


def _call(name: str) -> Callable[[Any, Any], None]:
    own, number = _OWN[name], _CALLS[name]

    @functools.wraps(own)
    def call(m: Any, d: Any) -> None:
        if _on_cpu(m, d):
            call_or_record(lambda: worlds_of(m, d).run(number))
        else:
            own(m, d)

    return call


@functools.wraps(_OWN["reset_data"])
def _reset_data(m: Any, d: Any, reset: Any = None) -> None:
    if not _on_cpu(m, d):
        return _OWN["reset_data"](m, d, reset)
    if reset is None:
        return call_or_record(lambda: worlds_of(m, d).run(_RESET))
    if reset.shape != (d.nworld,) or not (reset.dtype is wp.bool or wp.types.type_is_int(reset.dtype)) or not reset.device.is_cpu:
        raise ValueError(
            f"reset_data(): reset must be an array of {d.nworld} bools or integers on the CPU, "
            f"not {reset.dtype.__name__} {reset.shape} on {reset.device}"
        )

    def run() -> None:
        mask = np.ascontiguousarray(reset.numpy() != 0)
        worlds_of(m, d).run(_RESET, mask.ctypes.data)

    return call_or_record(run)


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
        call_or_record(lambda: _worlds[id(data)].cast(dict(query.arguments)))
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
        call_or_record(lambda: worlds_of(m, d).render(rc))
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
        fields = fields_of(name, given.arguments.get("groups"))
        fields = tuple(field for field in fields if getattr(model, field).size)
        if not _on_cpu(model, data) or id(model) not in _models or has_placeholders(name, model):
            return own(*args, **kwargs)

        def run() -> None:
            if not worlds_of(model, data).set_constants(fields, given.arguments.get("restore", False)):
                own(*args, **kwargs)

        call_or_record(run)

    return call


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
