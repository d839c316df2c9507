# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's physics options (mjOption) of a running simulation: which may change, their values, and ``sim.options``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol, overload

import numpy as np

from mjsense import _core
from mjsense.core.errors import did_you_mean

if TYPE_CHECKING:
    from numpy.typing import NDArray

PREFIX = "opt."
"""Fields of mjOption have names such as ``opt.gravity`` among the fields of the model."""

_POSITIVE = {"impratio"}
_AT_LEAST = {
    "density": 0,
    "viscosity": 0,
    "tolerance": 0,
    "ls_tolerance": 0,
    "noslip_tolerance": 0,
    "ccd_tolerance": 0,
    "sleep_tolerance": 0,
    "o_margin": 0,
    "o_friction": 0,
    "iterations": 1,
    "ls_iterations": 1,
    "noslip_iterations": 0,
    "ccd_iterations": 1,
    "sdf_initpoints": 1,
    "sdf_iterations": 1,
    "disableactuator": 0,
}
_COMPILED = ("sleep", "ipc")
"""Enable flags for which MuJoCo prepares the data when it is made."""


def check_option(name: str) -> None:
    """Raises ValueError for an option that is the same in all worlds."""
    if name == "timestep":
        raise ValueError(
            "opt.timestep: the same in all worlds; set sim.options.timestep at the beginning of an episode of all worlds"
        )


def option_values(name: str, values: Any) -> Any:
    """Numbers for words: ``"implicitfast"``, or the flags ``("contact", "gravity")``."""
    words: tuple[str, ...] = _core.option_words().get(name, ())
    given = [values] if isinstance(values, str) else values
    if not words or not isinstance(given, (list, tuple, set, frozenset)) or not all(isinstance(one, str) for one in given):
        return values
    for word in given:
        if word not in words:
            raise ValueError(f"opt.{name}: no value '{word}'{did_you_mean(word, words, 'there are')}")
    if name.endswith("flags"):
        return sum(1 << words.index(word) for word in set(given))
    if not isinstance(values, str):
        raise ValueError(f"opt.{name}: one word, or a number for each world, not {values!r:.100}")
    return words.index(values)


def check_option_values(name: str, values: np.ndarray, before: np.ndarray) -> None:
    """Raises ValueError for values that MuJoCo cannot use; the dtype and shape are right."""
    if name in _POSITIVE and not (values > 0).all():
        raise ValueError(f"opt.{name}: values must be positive; one is {values.min()}")
    if name in _AT_LEAST and (values < _AT_LEAST[name]).any():
        raise ValueError(f"opt.{name}: values must be at least {_AT_LEAST[name]}; one is {values.min()}")
    words: tuple[str, ...] = _core.option_words().get(name, ())
    if words:
        last = (1 << len(words)) - 1 if name.endswith("flags") else len(words) - 1
        if (values < 0).any() or (values > last).any():
            wrong = values[(values < 0) | (values > last)][0]
            raise ValueError(f"opt.{name}: values must be 0 to {last} ({', '.join(words)}), not {wrong}")
    if name == "enableflags":
        for flag in _COMPILED:
            if ((values ^ before) & (1 << words.index(flag))).any():
                raise ValueError(
                    f"opt.enableflags: '{flag}' cannot change in a simulation; set it before the scene is compiled: "
                    f'SceneCfg(options=MujocoCfg(enableflags=("{flag}",)))'
                )


class Owner(Protocol):
    """The part of a simulation that options read and write."""

    physics_dt: float

    def model_field(self, name: str) -> np.ndarray: ...
    def randomize(self, field: str, values: Any) -> None: ...
    def _set_timestep(self, seconds: float) -> None: ...


class _Option:
    """An option as an attribute: read-only values ``[B, ...]``; assignment sets it in all worlds."""

    def __init__(self, text: str) -> None:
        self.__doc__ = text

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, options: None, owner: type) -> _Option: ...
    @overload
    def __get__(self, options: Options, owner: type) -> NDArray[Any]: ...
    def __get__(self, options: Options | None, owner: type) -> _Option | NDArray[Any]:
        if options is None:
            return self
        values = options._sim.model_field(PREFIX + self._name).view()
        values.flags.writeable = False
        return values

    def __set__(self, options: Options, value: Any) -> None:
        options._sim.randomize(PREFIX + self._name, value)


class Options:
    """Physics options of a running simulation, ``sim.options``::

        sim.options.gravity = (0, 0, -1.62)                     # in all worlds, or [B, 3]
        sim.randomize("opt.wind", wind, world_ids=[0, 3])       # in some
        sim.options.disableflags = ("contact", "gravity")       # words, or MuJoCo's bits

    Reading gives the values of all worlds, ``[B, ...]``, read-only. Every change takes effect at once: derived quantities and
    sensors follow, and the next step uses it. Options stay until they are written again; a reset keeps them. A task or policy may
    set them, ``sample()`` for an episode; recordings store them for the replay.
    """

    gravity = _Option("Gravitational acceleration in the world frame, m/s^2 [B, 3].")
    wind = _Option("Velocity of the medium in the world frame, m/s [B, 3].")
    magnetic = _Option("Magnetic flux that magnetometers measure, in the world frame [B, 3].")
    density = _Option("Density of the medium, kg/m^3 [B].")
    viscosity = _Option("Viscosity of the medium, Pa s [B].")
    impratio = _Option("Ratio of frictional to normal constraint impedance [B].")
    integrator = _Option("Numerical integrator [B]; assign a word of MujocoCfg.integrator, or mjtIntegrator.")
    cone = _Option("Type of the friction cone [B]: pyramidal, elliptic.")
    jacobian = _Option("Storage of the constraint Jacobian [B]: dense, sparse, auto.")
    solver = _Option("Constraint solver [B]: pgs, cg, newton.")
    iterations = _Option("Maximum number of solver iterations [B].")
    tolerance = _Option("Termination tolerance of the solver [B].")
    ls_iterations = _Option("Maximum number of line search iterations [B].")
    ls_tolerance = _Option("Termination tolerance of the line search [B].")
    noslip_iterations = _Option("Maximum number of noslip solver iterations [B].")
    noslip_tolerance = _Option("Termination tolerance of the noslip solver [B].")
    ccd_iterations = _Option("Maximum number of iterations of convex collision detection [B].")
    ccd_tolerance = _Option("Termination tolerance of convex collision detection [B].")
    sdf_initpoints = _Option("Number of starting points in collisions of signed distance fields [B].")
    sdf_iterations = _Option("Number of iterations in collisions of signed distance fields [B].")
    sleep_tolerance = _Option("Velocity below which bodies may sleep [B].")
    o_margin = _Option("Contact margin with the flag override [B].")
    o_solref = _Option("Contact solref with the flag override [B, 2].")
    o_solimp = _Option("Contact solimp with the flag override [B, 5].")
    o_friction = _Option("Contact friction with the flag override [B, 5].")
    disableflags = _Option("Disabled features [B]: bits of mjtDisableBit; assign their lower-case MJCF names or the bits.")
    enableflags = _Option("Enabled features [B]: bits of mjtEnableBit; assign their lower-case MJCF names or the bits.")
    disableactuator = _Option("Bits of the groups whose actuators are disabled [B].")

    def __init__(self, sim: Owner) -> None:
        object.__setattr__(self, "_sim", sim)

    _sim: Owner

    @property
    def timestep(self) -> float:
        """Duration of a physics step, s, the same in all worlds. It can change while all worlds are at the beginning of an
        episode, unless a sensor's noise, delays, ray times or exposures were resolved to steps, and not in environments and
        recordings, whose robots have control periods."""
        return self._sim.physics_dt

    @timestep.setter
    def timestep(self, seconds: float) -> None:
        self._sim._set_timestep(seconds)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in dir(type(self)) or name[0] == "_":
            raise AttributeError(f"sim.options has no option '{name}'{did_you_mean(name, names(), 'there are')}")
        object.__setattr__(self, name, value)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"sim.options has no option '{name}'{did_you_mean(name, names(), 'there are')}")

    def __repr__(self) -> str:
        return f"<options of {self._sim!r}>"


def names() -> list[str]:
    """Names of the options."""
    return ["timestep", *(name for name, value in vars(Options).items() if isinstance(value, _Option))]
