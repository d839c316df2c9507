# SPDX-License-Identifier: Apache-2.0
"""Models that show what is simulated, and refuse writes, which would change nothing.

Arrays have NumPy's flag; assignments to attributes raise an error that says what to use instead.
"""

from __future__ import annotations

import functools
from typing import Any, NoReturn

import numpy as np

from mjsense.core import libmujoco, mujoco_views
from mjsense.scene.randomizable import is_randomizable

_ELEMENTS = {**mujoco_views.KINDS, "bind": "bind"}
"""Methods that give elements, with the prefix of their fields in mjModel."""


def refuse(model: Any, field: str) -> NoReturn:
    """Raises the error for a write to ``field``: ``opt.gravity``, ``geom_rgba``, ``vis.map.znear``."""
    if field.startswith("opt."):
        name = field.removeprefix("opt.")
        how = f"sim.options.{name} = value, or SceneCfg(options=MujocoCfg({name}=value)) before the scene is made"
    elif is_randomizable(model, field):
        how = f"sim.randomize('{field}', values)"
    else:
        how = "edit the spec before the scene is compiled, SceneCfg(spec_fn=function)"
    raise AttributeError(
        f"the model is read-only, and a write to '{field}' would not reach the simulation: use {how}; "
        "copy.copy(model) makes a model of your own"
    )


def frozen(value: Any) -> Any:
    """The value; an array is read-only from now on."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    return value


class _Part:
    """Options, statistics, visual settings or an element of a model."""

    def __init__(self, model: Any, part: Any, prefix: str) -> None:
        self.__dict__.update(_model=model, _part=part, _prefix=prefix)

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._part, name)
        if isinstance(value, (np.ndarray, np.generic, int, float, str, type)) or callable(value):
            return frozen(value)
        return _Part(self._model, value, f"{self._prefix}{name}.")

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        getattr(self._part, name)  # unknown names have an error of their own
        refuse(self._model, self._prefix + name)

    def __dir__(self) -> list[str]:
        return dir(self._part)

    def __repr__(self) -> str:
        return repr(self._part)

    @property
    def __class__(self) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        """That of the part: isinstance(model.opt, mujoco.MjOption) holds."""
        return type(self._part)


def _own_model(state: Any) -> Any:
    """A model in another process, which is of MuJoCo's own class."""
    import mujoco

    model = mujoco.MjModel.__new__(mujoco.MjModel)
    model.__setstate__(state)
    return model


@functools.cache
def _read_only_class() -> Any:
    """The subclass of mujoco.MjModel, which MuJoCo's functions accept."""
    assert libmujoco.shared is not None
    base = libmujoco.shared.MjModel

    def element(name: str) -> Any:
        method, prefix = getattr(base, name), f"{_ELEMENTS[name]}_"

        @functools.wraps(method)
        def call(self: Any, *args: Any, **kwargs: Any) -> Any:
            return _Part(self, method(self, *args, **kwargs), prefix)

        return call

    def part(name: str) -> Any:
        return property(lambda self: _Part(self, getattr(base, name).__get__(self), f"{name}."))

    def set_attribute(self: Any, name: str, value: Any) -> NoReturn:
        getattr(self, name)
        refuse(self, name)

    def reduce(self: Any, protocol: int) -> Any:
        return _own_model, (base.__getstate__(self),)

    members: dict[str, Any] = {name: element(name) for name in _ELEMENTS if hasattr(base, name)}
    members |= {name: part(name) for name in ("opt", "stat", "vis")}
    members |= {
        "__slots__": (),
        "__setattr__": set_attribute,
        "__reduce_ex__": reduce,
        "__module__": "mujoco",
        "__doc__": base.__doc__,
    }
    return type("MjModel", (base,), members)


class _ReadOnlyView(mujoco_views.MjModelView):
    """The same of a view."""

    def __getattr__(self, name: str) -> Any:
        value = super().__getattr__(name)
        if isinstance(value, mujoco_views._Struct):
            return _Part(self, value, f"{name}.")
        if name in _ELEMENTS and callable(value):
            return lambda key: _Part(self, value(key), f"{_ELEMENTS[name]}_")
        return frozen(value)

    def __setattr__(self, name: str, value: Any) -> NoReturn:
        getattr(self, name)
        refuse(self, name)


_ReadOnlyView.__name__ = "MjModelView"  # in messages


def read_only(model: Any) -> Any:
    """A read-only model with the values of this one, which is not used any more; of MuJoCo's class if it is."""
    if libmujoco.shared is None:
        return _ReadOnlyView(model._owner)
    cls = _read_only_class()
    made = cls.__new__(cls)
    # The only constructor of MuJoCo's bindings that works for subclasses.
    libmujoco.shared.MjModel.__setstate__(made, model.__getstate__())
    for name in dir(libmujoco.shared.MjModel):
        if name[0] != "_" and name not in _ELEMENTS:
            frozen(getattr(made, name))
    return made
